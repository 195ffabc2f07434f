! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The tables [[sample]]: starts drawn at random, for the shares of the attractors (basin stability; Menck, Heitzig, Marwan,
!> Kurths, Nature Physics 9, 2013).
module sample_reader
  use axis, only: axis_t, name_length
  use case_parameters, only: is_start, parameter_bounds
  use case_source, only: case_source_t, description, enter_table, find, has_problems, know, know_all_below, list_size, report
  use case_type, only: case_t, sample_t
  use case_values, only: bounds_t, more_than, take_integer, take_real, take_text
  use constants, only: two_pi
  use elementary, only: sine_cosine
  use grid, only: sample_axis
  use kinds, only: int64, real64, wp
  use law_table, only: is_start_parameter
  use random, only: uniform
  use text, only: to_text
  use toml_bindings, only: toml_array
  implicit none
  private

  public :: read_samples

  !> Most starts.
  integer, parameter :: most_samples = 100000000

contains

  !> Draws the starts, and appends the axis that counts them. The axes must have been read.
  subroutine read_samples(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(inout) :: the_case
    type(axis_t) :: counted
    integer :: i, at, count_names
    call know(source, 'sample[].name')
    call take_integer(source, 'grid.samples', 1, the_case%sample%count, highest=most_samples)
    call take_integer(source, 'grid.seed', 0, the_case%sample%seed)
    at = find(source, 'sample')
    if (at > 0) then
      if (source%entries(at)%entry%kind /= toml_array) then
        call report(source, 'sample', 'found '//description(source%entries(at)%entry)//', allowed tables [[sample]]')
        call know_all_below(source, 'sample')
      end if
    end if
    count_names = list_size(source, 'sample')
    associate (sample => the_case%sample)
      allocate (sample%names(count_names), sample%units(count_names), sample%kinds(count_names))
      allocate (sample%first(count_names), sample%second(count_names), source=0.0_wp)
      if (count_names == 0) return
      sample%names = ''
      sample%units = '1'
      do i = 1, count_names
        call read_sample(source, the_case, i)
      end do
      if (the_case%refine%active .or. find(source, 'refine') > 0) call report(source, 'refine', &
        'found with [[sample]], allowed with axes alone')
      if (has_problems(source, 'sample')) return
      allocate (sample%drawn(count_names, sample%count))
      call draw(sample)
    end associate
    counted%name = sample_axis
    counted%unit = '1'
    counted%values = [(real(i, wp), i=1, the_case%sample%count)]
    the_case%axes = [the_case%axes, counted]
    the_case%tile = [the_case%tile, 0]
  end subroutine read_samples

  !> name, and from and to, or mean and deviation.
  subroutine read_sample(source, the_case, number)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(inout) :: the_case
    integer, intent(in) :: number
    character(len=:), allocatable :: path, name
    type(bounds_t) :: bounds
    logical :: found
    path = 'sample['//to_text(number)//']'
    call enter_table(source, path, found)
    name = ''
    call take_text(source, path//'.name', name, required=.true.)
    call parameter_bounds(the_case%laws, name, bounds, found)
    if (.not. found .or. .not. (is_start(name) .or. is_start_parameter(name)) .or. len(name) > name_length) then
      if (len(name) > 0) call report(source, path//'.name', 'found "'//name//'", allowed x0, v0, crank_angle, and of several '// &
        'bodies body.NAME.x0, body.NAME.v0, structure.NAME.x0[1] ...')
      call know_all_below(source, path)
      return
    end if
    associate (sample => the_case%sample)
      if (any(sample%names(:number - 1) == name) .or. any(the_case%axes%name == name)) call report(source, path//'.name', &
        'found '''//name//''' again, allowed one axis or sample each')
      sample%names(number) = name
      sample%units(number) = trim(bounds%unit)
      sample%kinds(number) = 'uniform'
      call know(source, path//'.mean')
      call know(source, path//'.deviation')
      if (find(source, path//'.mean') + find(source, path//'.deviation') > 0) then
        sample%kinds(number) = 'normal'
        call take_real(source, path//'.mean', bounds, sample%first(number), required=.true.)
        call take_real(source, path//'.deviation', more_than(0.0_wp, bounds%unit), sample%second(number), required=.true.)
      else
        call take_real(source, path//'.from', bounds, sample%first(number), required=.true.)
        call take_real(source, path//'.to', bounds, sample%second(number), required=.true.)
        if (.not. has_problems(source, path) .and. .not. sample%second(number) > sample%first(number)) call report(source, &
          path//'.to', 'found '//to_text(sample%second(number))//', allowed more than from = '//to_text(sample%first(number)))
      end if
    end associate
  end subroutine read_sample

  !> Values that depend on the seed, the number of the point and the index in the list alone (Box and Muller's normal ones).
  pure subroutine draw(sample)
    type(sample_t), intent(inout) :: sample
    real(real64) :: words(2*size(sample%names))
    real(wp) :: sine, cosine
    integer :: i, k
    do i = 1, sample%count
      call uniform(int(sample%seed, int64), int(i, int64), words)
      do k = 1, size(sample%names)
        if (sample%kinds(k) == 'uniform') then
          sample%drawn(k, i) = sample%first(k) + (sample%second(k) - sample%first(k))*words(2*k - 1)
        else
          call sine_cosine(two_pi*words(2*k), sine, cosine)
          sample%drawn(k, i) = sample%first(k) + sample%second(k)*sqrt(-2*log(1 - words(2*k - 1)))*cosine
        end if
      end do
    end do
  end subroutine draw

end module sample_reader
