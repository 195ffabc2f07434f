! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A structure by its lowest modes, and what the others would have yielded.
module structure_reduction
  use eigen, only: undamped_modes
  use kinds, only: real64, wp
  use structure_block, only: rigid_share
  use structure_data, only: structure_data_t
  use text, only: to_text
  implicit none
  private

  public :: coordinates_of, keep_modes

contains

  !> Number of coordinates of a structure.
  pure integer function coordinates_of(content) result(n)
    type(structure_data_t), intent(in) :: content
    n = 0
    if (allocated(content%frequency)) then
      n = size(content%frequency)
    else if (allocated(content%mass)) then
      n = size(content%mass, 1)
    end if
  end function coordinates_of

  !> The lowest modes of a structure in place of its coordinates; `problem` is allocated if they cannot be kept.
  pure subroutine keep_modes(modes, content, problem)
    integer, intent(in) :: modes
    type(structure_data_t), intent(inout) :: content
    character(len=:), allocatable, intent(out) :: problem
    real(wp), allocatable :: squares(:), shapes(:, :)
    integer :: n
    n = coordinates_of(content)
    if (modes > n) then
      problem = 'found '//to_text(modes)//', allowed at most the '//to_text(n)//' there are'
      return
    end if
    if (allocated(content%frequency)) then
      call leave_out(content, content%frequency(modes + 1:), content%rows(:, modes + 1:))
      content%frequency = content%frequency(:modes)
      if (allocated(content%damping_ratio)) content%damping_ratio = content%damping_ratio(:modes)
      if (allocated(content%damping)) content%damping = content%damping(:modes, :modes)
      content%rows = content%rows(:, :modes)
      return
    end if
    allocate (squares(n), shapes(n, n))
    call undamped_modes(real(content%stiffness, wp), real(content%mass, wp), squares, shapes)
    if (squares(1) < -1e-8_wp*maxval(abs(squares))) then
      problem = 'found a stiffness matrix that is not positive semidefinite, allowed without modes'
      return
    end if
    where (squares < rigid_share*squares(n)) squares = 0
    call leave_out(content, real(sqrt(squares(modes + 1:)), real64), matmul(content%rows, real(shapes(:, modes + 1:), real64)))
    content%frequency = real(sqrt(squares(:modes)), real64)
    associate (kept => real(shapes(:, :modes), real64))
      if (allocated(content%damping)) content%damping = matmul(transpose(kept), matmul(content%damping, kept))
      content%rows = matmul(content%rows, kept)
    end associate
    deallocate (content%mass, content%stiffness)
  end subroutine keep_modes

  !> Notes the flexibility of modes that are not kept: their frequencies [rad/s] and the displacements of the points in them.
  pure subroutine leave_out(content, frequency, shapes)
    type(structure_data_t), intent(inout) :: content
    real(real64), intent(in) :: frequency(:), shapes(:, :)
    integer :: k, p
    allocate (content%left_out(size(shapes, 1), size(shapes, 1)), source=0.0_real64)
    do k = 1, size(frequency)
      if (.not. frequency(k) > 0) cycle
      do p = 1, size(shapes, 1)
        content%left_out(:, p) = content%left_out(:, p) + shapes(:, k)*(shapes(p, k)/frequency(k)**2)
      end do
    end do
  end subroutine leave_out

end module structure_reduction
