! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The modes of a multibody structure as its joints and constraints see them.
module mode_rows
  use eigen, only: modulus
  use multibody, only: multibody_t, offset_of
  use kinds, only: wp
  use mode_flow_type, only: mode_flow_t
  implicit none
  private

  public :: set_rows

contains

  !> Shapes and responses along the rows of the joints and in the forces of the constraints.
  pure subroutine set_rows(machine, flow, forcing, surface)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(inout) :: flow
    complex(wp), intent(in) :: forcing(:, :), surface(:, :)
    complex(wp) :: iw
    real(wp) :: largest, by_position(size(flow%held)), by_speed(size(flow%held))
    integer :: j, k, m, count_shapes, harmonics
    count_shapes = size(flow%exponent)
    harmonics = size(forcing, 2)
    allocate (flow%joint_shape(count_shapes, size(machine%joints)), flow%joint_response(harmonics, size(machine%joints)))
    allocate (flow%force_shape(count_shapes, size(flow%held)), flow%force_response(harmonics, size(flow%held)))
    do j = 1, size(machine%joints)
      do k = 1, count_shapes
        flow%joint_shape(k, j) = sum(machine%joints(j)%row*flow%shape(:, k))
      end do
      do m = 1, harmonics
        flow%joint_response(m, j) = sum(machine%joints(j)%row*flow%response(:, m)) + offset_of(machine%joints(j), m)
      end do
    end do
    allocate (flow%size_of_joint(count_shapes, size(machine%joints)), flow%size_of_force(count_shapes, size(flow%held)))
    allocate (flow%size_of_force_response(harmonics, size(flow%held)))
    by_position = sum(matmul(abs(flow%reaction), abs(flow%stiffness)), dim=2)
    by_speed = sum(matmul(abs(flow%reaction), abs(flow%damping)), dim=2)
    do k = 1, count_shapes
      largest = maxval(modulus(flow%shape(:, k)))
      flow%size_of_joint(k, :) = largest*[(sum(abs(machine%joints(j)%row)), j=1, size(machine%joints))]
      flow%size_of_force(k, :) = largest*(by_position + flow%size_of_exponent(k)*by_speed)
      flow%force_shape(k, :) = matmul(flow%reaction, matmul(flow%stiffness, flow%shape(:, k)) &
                                      + flow%exponent(k)*matmul(flow%damping, flow%shape(:, k)))
    end do
    do m = 1, harmonics
      iw = cmplx(0.0_wp, m*machine%frequency, wp)
      flow%force_response(m, :) = matmul(flow%reaction, matmul(flow%stiffness, flow%response(:, m)) &
                                         + iw*matmul(flow%damping, flow%response(:, m)) - forcing(:, m)) &
                                  - iw**2*matmul(flow%hold, surface(:, m))
      largest = maxval(modulus(flow%response(:, m)))
      flow%size_of_force_response(m, :) = largest*(by_position + m*machine%frequency*by_speed) &
                                          + matmul(abs(flow%reaction), modulus(forcing(:, m))) &
                                          + (m*machine%frequency)**2*matmul(abs(flow%hold), modulus(surface(:, m)))
    end do
  end subroutine set_rows

end module mode_rows
