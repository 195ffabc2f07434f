! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether a file of boundaries is sound: what must hold of its pieces and saddles, and starts on both sides of some of its points
!> run again, in double and in quadruple precision.
module boundary_audit
  use audit, only: audit_t, sampled
  use basin, only: catalogue_t, open_ensemble
  use bisection, only: label_starts
  use case_setup, only: grid_of, options_of, span_of
  use case_type, only: case_t
  use errors, only: error_t, fail
  use file_layout, only: axis_dimension
  use grid, only: grid_t, point_laws, point_slice, point_start, two_axes
  use journal, only: journal_t
  use kinds, only: int64, wp
  use law_table, only: change_parameter, law_choice_t
  use map_reader, only: reader_t
  use reference, only: run_reference
  use serial_team, only: serial_team_t
  use start_label, only: label_left_domain
  use status, only: exit_io, reason_left_domain
  use stored_map, only: restore_catalogues
  use text, only: to_text
  use trajectory_slots, only: describe_regime, ensemble_t
  implicit none
  private

  public :: check_boundary, audit_boundary

  !> Where rounding has moved a boundary, labels are asked for at so many times half the width of its interval.
  integer, parameter :: widths(3) = [1, 10, 100]

  !> The points of a file, and the piece of each.
  type :: points_t
    real(wp), allocatable :: position(:, :), below(:), above(:), error(:), across(:)
    integer, allocatable :: piece(:)
  end type points_t

contains

  !> Checks that the pieces cover the points, that labels and names fit, and that saddles are some. `points` is how many points
  !> there are. Code 74 names the first violation.
  subroutine check_boundary(reader, points, error)
    type(reader_t), intent(in) :: reader
    integer(int64), intent(out) :: points
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: table(:, :), pieces(:, :), orbits(:, :)
    integer :: p, i, orbit
    points = 0
    call reader%read_columns([character(len=10) :: '/across', '/below', '/above', '/error', '/name', '/saddle'], table, error)
    if (.not. allocated(error)) call reader%read_columns([character(len=10) :: '/first', '/points', '/label_one', '/label_two'], &
                                                         pieces, error)
    if (.not. allocated(error)) call reader%read_columns([character(len=26) :: '/saddles/period', '/saddles/boundary_points'], &
                                                         orbits, error)
    if (.not. allocated(error)) call check_saddles(reader, size(orbits, 1), error)
    if (allocated(error)) return
    points = size(table, 1)
    i = 0
    do p = 1, size(pieces, 1)
      if (nint(pieces(p, 1)) /= i) call complain('piece', p, 'does not begin where the one before ends')
      if (nint(pieces(p, 2)) < 1 .or. i + nint(pieces(p, 2)) > points) call complain('piece', p, 'has no such points')
      if (allocated(error)) return
      do i = i + 1, i + nint(pieces(p, 2))
        orbit = nint(table(i, 6))
        if (.not. table(i, 4) >= 0) call complain('point', i, 'has no width')
        if (orbit < 0 .or. orbit > size(orbits, 1) .or. (orbit > 0 .neqv. nint(table(i, 5)) == 1)) then
          call complain('point', i, 'is part of the stable set of no saddle')
        end if
        if (nint(table(i, 1)) >= 0 .and. (nint(minval(table(i, 2:3))) /= nint(pieces(p, 3)) .or. &
                                          nint(maxval(table(i, 2:3))) /= nint(pieces(p, 4)))) then
          call complain('point', i, 'has not the labels of its piece')
        end if
        if (nint(table(i, 1)) >= 0 .and. nint(table(i, 2)) == nint(table(i, 3))) call complain('point', i, 'parts nothing')
        if (allocated(error)) return
      end do
      i = i - 1
    end do
    if (i /= points) call complain('piece', size(pieces, 1), 'is the last and does not end with the last point')

  contains

    subroutine complain(what, number, text)
      character(len=*), intent(in) :: what, text
      integer, intent(in) :: number
      if (allocated(error)) return
      call fail(error, exit_io, "'"//reader%path//"', "//what//' '//to_text(number - 1)//': '//text)
    end subroutine complain

  end subroutine check_boundary

  !> A saddle has one multiplier outside of the unit circle and the others inside.
  subroutine check_saddles(reader, saddles, error)
    type(reader_t), intent(in) :: reader
    integer, intent(in) :: saddles
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: re(:), im(:), moduli(:, :)
    integer :: k
    if (saddles == 0) return
    call reader%read_values('/saddles/multipliers', re, error)
    if (.not. allocated(error)) call reader%read_values('/saddles/multipliers_imag', im, error)
    if (allocated(error)) return
    moduli = reshape(hypot(re, im), [size(re)/saddles, saddles])
    do k = 1, saddles
      if (moduli(1, k) > 1 .and. all(moduli(2:, k) < 1)) cycle
      call fail(error, exit_io, "'"//reader%path//"', saddle "//to_text(k)//': its multipliers are not those of a saddle')
      return
    end do
  end subroutine check_saddles

  !> Runs starts on both sides of random points again, after the catalogues have been searched again: in double precision they
  !> must have the labels of the file; in quadruple precision a label that differs is a flip.
  subroutine audit_boundary(reader, journal, the_case, sample, seed, audit, error)
    type(reader_t), intent(in) :: reader
    type(journal_t), intent(inout) :: journal
    type(case_t), intent(in) :: the_case
    integer, intent(in) :: sample, seed
    type(audit_t), intent(inout) :: audit
    type(error_t), allocatable, intent(out) :: error
    type(serial_team_t) :: alone
    type(grid_t) :: grid
    type(catalogue_t), allocatable :: catalogues(:)
    type(ensemble_t) :: ensemble
    type(points_t) :: points
    integer, allocatable :: found(:), index(:, :)
    integer :: axes(2), i, k, chosen(1)
    grid = grid_of(the_case, the_case%axes)
    axes = two_axes(grid)
    call read_points(reader, grid, axes, points, index, error)
    if (allocated(error)) return
    found = pack([(i, i=1, size(points%across))], nint(points%across) >= 0)
    if (size(found) == 0) return
    call restore_catalogues(reader, alone, journal, grid, the_case, catalogues, error)
    if (allocated(error)) return
    audit%whole = size(found) <= sample
    call journal%begin('points run again', int(min(sample, size(found)), int64), 0_int64)
    do i = 1, min(sample, size(found))
      chosen = sampled([size(found)], audit%whole, seed, i)
      k = found(chosen(1))
      associate (here => index(:, points%piece(k)))
        call open_ensemble(grid, span_of(the_case), point_slice(grid, here), describe_regime, ensemble, error)
        if (.not. allocated(error)) call compare_sides(grid, axes, here, points, k, ensemble, &
                                                       catalogues(point_slice(grid, here) + 1), the_case, audit, error)
      end associate
      if (allocated(error)) return
      call journal%progress(int(i, int64))
    end do
    audit%changes = audit%flips
  end subroutine audit_boundary

  !> The points of a file, and for each piece the index in the grid of its plane (1 along the axes of the plane).
  subroutine read_points(reader, grid, axes, points, index, error)
    type(reader_t), intent(in) :: reader
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: axes(2)
    type(points_t), intent(out) :: points
    integer, allocatable, intent(out) :: index(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: table(:, :), pieces(:, :), values(:)
    character(len=64) :: names(6)
    integer :: p, i
    do i = 1, 2
      names(i) = '/'//axis_dimension(grid%axes(axes(i))%name)
    end do
    names(3:) = [character(len=64) :: '/below', '/above', '/error', '/across']
    call reader%read_columns(names, table, error)
    if (.not. allocated(error)) call reader%read_columns([character(len=8) :: '/first', '/points'], pieces, error)
    if (allocated(error)) return
    points%position = transpose(table(:, :2))
    points%below = table(:, 3)
    points%above = table(:, 4)
    points%error = table(:, 5)
    points%across = table(:, 6)
    points%piece = [((p, i=1, nint(pieces(p, 2))), p=1, size(pieces, 1))]
    allocate (index(size(grid%axes), size(pieces, 1)), source=1)
    do i = 1, size(grid%axes)
      if (any(axes == i)) cycle
      call reader%read_values('/piece_'//axis_dimension(grid%axes(i)%name), values, error)
      if (allocated(error)) return
      index(i, :) = [(minloc(abs(grid%axes(i)%values - values(p)), 1), p=1, size(values))]
    end do
  end subroutine read_points

  !> Whether the labels on both sides of point `k` are those of the file, in the plane through the index `here`: at the ends of its
  !> interval in double precision, in quadruple precision there or a little further out, where rounding does not matter.
  subroutine compare_sides(grid, axes, here, points, k, ensemble, catalogue, the_case, audit, error)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: axes(2), here(:), k
    type(points_t), intent(in) :: points
    type(ensemble_t), intent(in) :: ensemble
    type(catalogue_t), intent(in) :: catalogue
    type(case_t), intent(in) :: the_case
    type(audit_t), intent(inout) :: audit
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: starts(3 + size(grid%others), 2), position(2)
    integer :: labels(2), wanted(2), side, w
    logical :: confirmed, exact
    wanted = nint([points%below(k), points%above(k)])
    audit%points = audit%points + 1
    call ends_of_interval(grid, axes, here, points, k, starts, exact)
    if (exact) then
      call label_starts(ensemble, catalogue%attractors, starts, labels)
      if (any(labels /= wanted)) then
        audit%differing = audit%differing + 1
        if (audit%differing == 1) audit%first_difference = 'point '//to_text(k - 1)//': the file has '//to_text(wanted(1))// &
          ' and '//to_text(wanted(2))//' on its sides, rerun gives '//to_text(labels(1))//' and '//to_text(labels(2))
        return
      end if
    end if
    do w = 1, size(widths)
      do side = 1, 2
        position = points%position(:, k)
        associate (along => nint(points%across(k)) + 1)
          position(along) = position(along) + (2*side - 3)*widths(w)*points%error(k)
        end associate
        starts(:, side) = start_at(grid, axes, here, position)
      end do
      call ask_reference(laws_at(grid, axes, here, points%position(:, k)), ensemble, catalogue, the_case, starts(:3, :), wanted, &
                         confirmed, error)
      if (allocated(error)) return
      if (confirmed) exit
    end do
    if (w > 1 .and. confirmed) audit%wider = audit%wider + 1
    if (.not. confirmed) audit%flips = audit%flips + 1
  end subroutine compare_sides

  !> The starts at the ends of the interval of point `k`, to the bit: they are halves of halves of an edge of the map. Not `exact`
  !> where intervals with starts that are not known between them were joined.
  subroutine ends_of_interval(grid, axes, here, points, k, starts, exact)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: axes(2), here(:), k
    type(points_t), intent(in) :: points
    real(wp), intent(out) :: starts(:, :)
    logical, intent(out) :: exact
    real(wp) :: from(size(starts, 1)), to(size(starts, 1)), pieces, low
    integer :: index(size(here)), i, along
    along = nint(points%across(k)) + 1
    index = here
    do i = 1, 2
      associate (values => grid%axes(axes(i))%values)
        index(axes(i)) = minloc(abs(values - points%position(i, k)), 1)
        if (i == along) index(axes(i)) = max(1, min(size(values) - 1, count(values <= points%position(i, k))))
      end associate
    end do
    from = point_start(grid, index)
    associate (values => grid%axes(axes(along))%values, at => index(axes(along)))
      pieces = (values(at + 1) - values(at))/(2*points%error(k))
      low = (points%position(along, k) - points%error(k) - values(at))/(values(at + 1) - values(at))
      at = at + 1
    end associate
    to = point_start(grid, index)
    exact = pieces < 1e15_wp
    if (.not. exact) return
    exact = abs(log(pieces)/log(2.0_wp) - anint(log(pieces)/log(2.0_wp))) < 1e-3_wp
    pieces = 2.0_wp**nint(log(pieces)/log(2.0_wp))
    starts(:, 1) = from + anint(low*pieces)/pieces*(to - from)
    starts(:, 2) = from + (anint(low*pieces) + 1)/pieces*(to - from)
  end subroutine ends_of_interval

  !> Whether both starts have the labels `wanted` in quadruple precision.
  subroutine ask_reference(laws, ensemble, catalogue, the_case, starts, wanted, same, error)
    type(law_choice_t), intent(in) :: laws(:)
    type(ensemble_t), intent(in) :: ensemble
    type(catalogue_t), intent(in) :: catalogue
    type(case_t), intent(in) :: the_case
    real(wp), intent(in) :: starts(:, :)
    integer, intent(in) :: wanted(2)
    logical, intent(out) :: same
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: results(6, 1)
    integer :: side, label
    same = .false.
    do side = 1, 2
      call run_reference(laws, options_of(the_case), ensemble%span, catalogue%attractors, starts(:, side:side), results, error)
      if (allocated(error)) return
      label = max(nint(results(2, 1)), 0)
      if (label == 0 .and. nint(results(1, 1)) == reason_left_domain) label = label_left_domain
      if (label /= wanted(side)) return
    end do
    same = .true.
  end subroutine ask_reference

  !> The start at a position of the plane: starts go evenly along an axis.
  pure function start_at(grid, axes, here, position) result(start)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: axes(2), here(:)
    real(wp), intent(in) :: position(2)
    real(wp) :: start(3 + size(grid%others)), corner(3 + size(grid%others)), further(3 + size(grid%others))
    integer :: index(size(here)), i, n
    corner = point_start(grid, here)
    start = corner
    do i = 1, 2
      associate (values => grid%axes(axes(i))%values)
        n = size(values)
        index = here
        index(axes(i)) = n
        further = point_start(grid, index)
        start = start + (position(i) - values(1))/(values(n) - values(1))*(further - corner)
      end associate
    end do
  end function start_at

  !> The laws of the machine there, with the starts of further bodies in them.
  pure function laws_at(grid, axes, here, position) result(laws)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: axes(2), here(:)
    real(wp), intent(in) :: position(2)
    type(law_choice_t), allocatable :: laws(:)
    integer :: i, k
    logical :: known
    laws = point_laws(grid, here)
    do k = 4, size(grid%start_axis)
      i = findloc(axes, grid%start_axis(k), 1)
      if (i > 0) call change_parameter(laws, grid%start_names(k), position(i), known)
    end do
  end function laws_at

end module boundary_audit
