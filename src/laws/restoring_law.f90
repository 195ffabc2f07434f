! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Restoring forces as functions of the extension, (free length + foot position) - (body position).
!> A new law adds a kind here, a row to `law_table`, a branch to both functions and a test; if it is not
!> linear in the extension, `is_linear` stays false and the adaptive flight takes over.
module restoring_law
  use constants, only: two_pi
  use elementary, only: sine_cosine
  use kinds, only: wp
  use law_table, only: law_choice_t, value_of
  use part_angles, only: watched_is_angle
  implicit none
  private

  public :: restoring_of, position_is_angle, restoring_force, restoring_stiffness, restoring_energy

  integer, parameter :: kind_none = 0, kind_linear = 1, kind_pendulum = 2

  type, public :: restoring_t
    integer :: kind = kind_none
    !> Stiffness at zero extension [N/m]; gives the natural frequency.
    real(wp) :: stiffness = 0
    !> Distance between foot and body without extension [m].
    real(wp) :: free_length = 0
    logical :: is_linear = .true.
    !> The extension after which the force repeats, where it is an angle [rad]; 0 if it never does.
    real(wp) :: turn = 0
  end type restoring_t

contains

  !> The law that a choice of the family `restoring` names.
  pure function restoring_of(choice) result(law)
    type(law_choice_t), intent(in) :: choice
    type(restoring_t) :: law
    if (choice%name == 'pendulum') law = restoring_t(kind_pendulum, value_of(choice, 'moment'), 0.0_wp, .false., two_pi)
    if (choice%name == 'linear') then
      law = restoring_t(kind_linear, value_of(choice, 'stiffness'), &
                        value_of(choice, 'free_length'), .true.)
    end if
  end function restoring_of

  !> Whether the position of a machine of these laws is an angle.
  pure logical function position_is_angle(choices)
    type(law_choice_t), intent(in) :: choices(:)
    type(restoring_t) :: law
    integer :: i
    position_is_angle = watched_is_angle(choices)
    do i = 1, size(choices)
      if (choices(i)%family /= 'restoring') cycle
      law = restoring_of(choices(i))
      position_is_angle = position_is_angle .or. law%turn > 0
    end do
  end function position_is_angle

  !> Force on the body [N] at an extension [m].
  pure elemental real(wp) function restoring_force(law, extension)
    type(restoring_t), intent(in) :: law
    real(wp), intent(in) :: extension
    real(wp) :: sine, cosine
    select case (law%kind)
    case (kind_linear)
      restoring_force = law%stiffness*extension
    case (kind_pendulum)
      call sine_cosine(extension, sine, cosine)
      restoring_force = law%stiffness*sine
    case default
      restoring_force = 0
    end select
  end function restoring_force

  !> Derivative of the force with respect to the extension [N/m].
  pure elemental real(wp) function restoring_stiffness(law, extension)
    type(restoring_t), intent(in) :: law
    real(wp), intent(in) :: extension
    real(wp) :: sine, cosine
    select case (law%kind)
    case (kind_linear)
      restoring_stiffness = law%stiffness
    case (kind_pendulum)
      call sine_cosine(extension, sine, cosine)
      restoring_stiffness = law%stiffness*cosine
    case default
      restoring_stiffness = 0*extension
    end select
  end function restoring_stiffness

  !> Energy stored at an extension [m], in J.
  pure elemental real(wp) function restoring_energy(law, extension)
    type(restoring_t), intent(in) :: law
    real(wp), intent(in) :: extension
    real(wp) :: sine, cosine
    select case (law%kind)
    case (kind_linear)
      restoring_energy = 0.5_wp*law%stiffness*extension**2
    case (kind_pendulum)
      call sine_cosine(extension/2, sine, cosine)
      restoring_energy = 2*law%stiffness*sine**2
    case default
      restoring_energy = 0
    end select
  end function restoring_energy

end module restoring_law
