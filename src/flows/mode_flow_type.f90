! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What the linear motion of a multibody structure in one mode of its joints is made of.
module mode_flow_type
  use kinds, only: int64, wp
  implicit none
  private

  type, public :: mode_flow_t
    !> A bit per joint.
    integer(int64) :: key = -1
    logical :: modal = .false.
    !> Joints that are constraints, and those of them that do not depend on the others.
    integer, allocatable :: held(:), independent(:)
    !> Joints that the constraints, all with surfaces of constant speed, keep from moving or at one speed.
    logical, allocatable :: still(:)
    !> Structure with the springs of the joints.
    real(wp), allocatable :: stiffness(:, :), damping(:, :)
    !> Where unit coordinates of the independent constraints move the structure, statically in the metric of the masses.
    real(wp), allocatable :: carried(:, :)
    !> Forces of the constraints per force on the coordinates, and per acceleration of their surfaces.
    real(wp), allocatable :: reaction(:, :), hold(:, :)
    !> Free directions (columns, orthonormal in the metric of the masses): flexible, damped rigid, rigid.
    real(wp), allocatable :: basis(:, :)
    integer :: flexible = 0, damped = 0, rigid = 0
    !> Natural frequencies of the flexible ones [rad/s].
    real(wp), allocatable :: frequency(:)
    !> Exponents, shapes in the coordinates (of a conjugate pair one, twofold), and rows that give their amplitudes
    !> from basis coordinates times frequency and their speeds.
    complex(wp), allocatable :: exponent(:), shape(:, :), left(:, :)
    real(wp), allocatable :: size_of_exponent(:), size_of_left(:, :)
    !> Amplitude of the damped rigid coordinates per amplitude of the exponentials.
    complex(wp), allocatable :: drift(:, :)
    !> Periodic response of the coordinates to the harmonics.
    complex(wp), allocatable :: response(:, :)
    !> Shapes and responses along the rows of the joints, and of the forces of the constraints.
    complex(wp), allocatable :: joint_shape(:, :), joint_response(:, :), force_shape(:, :), force_response(:, :)
    !> Bounds on what rounding of the shapes and responses takes for its measure there: the largest entry of each, and no force that
    !> others cancel.
    real(wp), allocatable :: size_of_joint(:, :), size_of_force(:, :), size_of_force_response(:, :)
    !> Matrix of the coordinates, their speeds, 1, the time, cosines and sines; bound on its rate [1/s].
    real(wp), allocatable :: matrix(:, :)
    real(wp) :: rate = 0
    !> Rows of the joint coordinates, their speeds, and the forces of the constraints over the same unknowns.
    real(wp), allocatable :: position_row(:, :), speed_row(:, :), force_row(:, :)
    !> Sizes of what the rows of the forces are sums of.
    real(wp), allocatable :: size_of_force_row(:, :)
  end type mode_flow_t

end module mode_flow_type
