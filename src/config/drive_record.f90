! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A measured force on a body of several, or its measured motion: record = "FILE.csv" of a [drive.NAME], instead of its frequency
!> and series. The record is one period, by the rule of one body: a last sample that is the first once more begins the next.
module drive_record
  use case_source, only: assume, case_source_t, find, know, report
  use case_values, only: take_integer, take_text
  use constants, only: two_pi
  use drive_law, only: ends_with_its_first
  use elementary, only: sine_cosine
  use force_record, only: read_force
  use kinds, only: wp
  use law_table, only: law_choice_t, set_value
  use text, only: to_text
  implicit none
  private

  public :: read_record

  !> Harmonics of a record for which none are given; more than this share of the record left is refused then.
  integer, parameter :: usual_harmonics = 32, most_harmonics = 256
  real(wp), parameter :: most_left = 0.05_wp

contains

  !> Takes frequency and series of a drive out of its record; `found` is false if it has none.
  subroutine read_record(source, path, choice, found)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(law_choice_t), intent(inout) :: choice
    logical, intent(out) :: found
    character(len=9), parameter :: others(6) = [character(len=9) :: 'frequency', 'mean', 'amplitude', 'angle', 'cosine', 'sine']
    character(len=:), allocatable :: file, problem
    real(wp), allocatable :: force(:), cosine(:), sine(:)
    real(wp) :: interval, mean, left
    integer :: harmonics, i
    logical :: harmonics_text
    found = find(source, path//'.record') > 0
    if (.not. found) return
    file = ''
    call take_text(source, path//'.record', file)
    harmonics = usual_harmonics
    call know(source, path//'.periodic')
    harmonics_text = find(source, path//'.harmonics') > 0
    call take_integer(source, path//'.harmonics', 1, harmonics, highest=most_harmonics)
    do i = 1, size(others)
      call know(source, path//'.'//trim(others(i)))
      if (find(source, path//'.'//trim(others(i))) > 0) call report(source, path//'.'//trim(others(i)), &
        'found beside a record, allowed one or the other')
    end do
    if (len(file) == 0) return
    if (index(file, '/') /= 1) file = source%name(:index(source%name, '/', back=.true.))//file
    call read_force(file, merge('x    ', 'force', choice%name == 'drive:motion'), interval, force, problem)
    if (allocated(problem)) then
      call report(source, path//'.record', problem)
      return
    end if
    call take_one_period(source, path, force)
    if (size(force) < 3) then
      call report(source, path//'.record', 'found '//to_text(size(force))//' samples of one period, allowed 3 or more')
      return
    end if
    call series_of(force, min(harmonics, (size(force) - 1)/2), mean, cosine, sine, left)
    if (find(source, path//'.periodic') == 0) call assume(source, path//'.record has the period '// &
                                                         to_text(interval*size(force), 6)//' s')
    if (.not. harmonics_text) call assume(source, path//'.harmonics = '//to_text(size(cosine))//' (they leave '// &
                                          to_text(100*left, 2)//' %)')
    if (left > most_left .and. .not. harmonics_text) then
      call report(source, path//'.record', 'found a record of which '//to_text(usual_harmonics)//' harmonics leave '// &
                  to_text(nint(100*left))//' %, allowed with the number of harmonics given: '//path//'.harmonics, 1 to '// &
                  to_text(most_harmonics))
    end if
    call set_value(choice, 'frequency', [two_pi/(interval*size(force))])
    call set_value(choice, 'mean', [mean])
    call set_value(choice, 'cosine', cosine)
    call set_value(choice, 'sine', sine)
  end subroutine read_record

  !> Keeps the samples of one period: all, or without a last one that is the first once more. With `periodic` = 0 the period ends
  !> with the last sample, whatever it is, in the middle between it and the first.
  subroutine take_one_period(source, path, force)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    real(wp), allocatable, intent(inout) :: force(:)
    integer :: periodic
    logical :: closed
    closed = ends_with_its_first(force)
    periodic = merge(0, 1, closed)
    call take_integer(source, path//'.periodic', 0, periodic, highest=1)
    if (periodic == 1 .and. closed) call report(source, path//'.periodic', 'found 1 with the first sample, '// &
      to_text(force(1))//', once more at the end of the record; allowed without it, or 0')
    if (periodic == 1) return
    force(1) = (force(1) + force(size(force)))/2
    force = force(:size(force) - 1)
  end subroutine take_one_period

  !> Mean and harmonics of samples at equal steps over one period, and the root mean square of what they leave, as a share of
  !> that of the samples about their mean.
  pure subroutine series_of(samples, harmonics, mean, cosine, sine, left)
    real(wp), intent(in) :: samples(:)
    integer, intent(in) :: harmonics
    real(wp), intent(out) :: mean, left
    real(wp), allocatable, intent(out) :: cosine(:), sine(:)
    real(wp) :: rest(size(samples)), s, c, whole
    integer :: k, m, n
    n = size(samples)
    allocate (cosine(harmonics), sine(harmonics), source=0.0_wp)
    mean = sum(samples)/n
    rest = samples - mean
    whole = sum(rest**2)
    do m = 1, harmonics
      do k = 1, n
        call sine_cosine(two_pi*modulo(m*(k - 1), n)/n, s, c)
        cosine(m) = cosine(m) + 2*(samples(k) - mean)*c/n
        sine(m) = sine(m) + 2*(samples(k) - mean)*s/n
      end do
      do k = 1, n
        call sine_cosine(two_pi*modulo(m*(k - 1), n)/n, s, c)
        rest(k) = rest(k) - cosine(m)*c - sine(m)*s
      end do
    end do
    left = sqrt(sum(rest**2)/max(whole, tiny(whole)))
  end subroutine series_of

end module drive_record
