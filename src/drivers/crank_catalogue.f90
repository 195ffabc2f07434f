! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What the crank of a motor does on each cycle of the catalogues of a map: columns of the catalogue in its file.
module crank_catalogue
  use basin, only: catalogue_t
  use crank_summary, only: crank_numbers, crank_outcomes, crank_summary_t, crank_table, crank_values, last_crank_outcome, &
    no_summary
  use crank_turns, only: summarize_attractor
  use entry_walk, only: begin_walk, entry_walk_t
  use grid, only: grid_t
  use kinds, only: wp
  use map_schema, only: schema_t, type_float64, type_int8
  use motor_choices, only: has_motor
  use team, only: team_t
  use text, only: join
  implicit none
  private

  public :: add_crank_catalogue

contains

  !> Adds the columns of a machine with a motor; values of what is no cycle are not numbers. The ranks share the slices.
  subroutine add_crank_catalogue(team, grid, catalogues, schema)
    class(team_t), intent(in) :: team
    type(grid_t), intent(in) :: grid
    type(catalogue_t), intent(in) :: catalogues(:)
    type(schema_t), intent(inout) :: schema
    real(wp), allocatable :: values(:, :)
    integer :: i
    if (.not. has_motor(grid%laws)) return
    call summarize_entries(team, grid, catalogues, values)
    if (size(values, 2) == 0) return
    call schema%add_variable('crank_angle', type_float64, ['entry'], units='rad', group='catalogue', data=angles_of(catalogues), &
                             long_name='angle of the crank at the section, or where it is at rest')
    call schema%add_variable('crank_outcome', type_int8, ['entry'], units='1', group='catalogue', data=values(1, :), &
                             long_name='outcome of a run-up of the crank', flag_values=[(i, i=0, last_crank_outcome)], &
                             flag_meanings=join(crank_outcomes, ' '))
    do i = 1, crank_numbers
      call schema%add_variable(trim(crank_table(i)%name), type_float64, ['entry'], units=trim(crank_table(i)%unit), &
                               long_name=trim(crank_table(i)%meaning), data=values(1 + i, :), group='catalogue')
    end do
  end subroutine add_crank_catalogue

  !> Angle of the crank of every entry, slice after slice.
  pure function angles_of(catalogues) result(angles)
    type(catalogue_t), intent(in) :: catalogues(:)
    real(wp), allocatable :: angles(:)
    integer :: i
    allocate (angles(0))
    do i = 1, size(catalogues)
      angles = [angles, catalogues(i)%attractors%section(3)]
    end do
  end function angles_of

  !> Outcome and numbers of every entry (columns), slice after slice.
  subroutine summarize_entries(team, grid, catalogues, values)
    class(team_t), intent(in) :: team
    type(grid_t), intent(in) :: grid
    type(catalogue_t), intent(in) :: catalogues(:)
    real(wp), allocatable, intent(out) :: values(:, :)
    type(entry_walk_t) :: walk
    type(crank_summary_t) :: crank
    logical :: found
    walk = begin_walk(team, catalogues)
    do
      call walk%next(grid, found)
      if (.not. found) exit
      call summarize_attractor(walk%machine, catalogues(walk%catalogue)%attractors(walk%attractor), crank)
      call walk%note([real(crank%outcome, wp), crank_values(crank)])
    end do
    call walk%gather(team, [0.0_wp, crank_values(no_summary())], values)
  end subroutine summarize_entries

end module crank_catalogue
