! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a structure file holds: matrices, or modes.
module structure_data
  use kinds, only: real64
  implicit none
  private

  public :: joined

  !> Most coordinates of a file; a case reduces them to fewer modes.
  integer, parameter, public :: most_file_coordinates = 200
  integer, parameter, public :: point_name_length = 32

  !> Either mass and stiffness, or frequency. What is not in the file is not allocated.
  type, public :: structure_data_t
    !> M, C and K; C also in the coordinates of modes.
    real(real64), allocatable :: mass(:, :), damping(:, :), stiffness(:, :)
    !> Of mass-normalised modes: angular frequencies [rad/s] and damping ratios.
    real(real64), allocatable :: frequency(:), damping_ratio(:)
    !> Named points; row p of `rows` times the coordinates is the displacement of point p [m].
    character(len=point_name_length), allocatable :: point_names(:)
    real(real64), allocatable :: rows(:, :)
    !> Displacement of a point per force at another by the modes that were left out [m/N].
    real(real64), allocatable :: left_out(:, :)
  end type structure_data_t

  !> Reads the file `path`; `problem` is allocated if it cannot be used, `missing`: it cannot be opened.
  abstract interface
    subroutine structure_file_reader(path, content, problem, missing)
      import :: structure_data_t
      character(len=*), intent(in) :: path
      type(structure_data_t), intent(out) :: content
      character(len=:), allocatable, intent(out) :: problem
      logical, intent(out) :: missing
    end subroutine structure_file_reader
  end interface

  public :: structure_file_reader

contains

  !> A matrix row by row, as case files have it.
  pure function joined(matrix) result(values)
    real(real64), intent(in) :: matrix(:, :)
    real(real64), allocatable :: values(:)
    values = reshape(transpose(matrix), [size(matrix)])
  end function joined

end module structure_data
