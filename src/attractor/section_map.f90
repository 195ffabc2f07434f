! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The map from section to section of a machine, and its derivative.
module section_map
  use circle, only: point_near
  use kinds, only: wp
  use machine_type, only: machine_t, section_state_t
  use motion_state, only: tally_t
  use section_size, only: most_coordinates
  use section_slopes, only: slopes_of
  implicit none
  private

  public :: map_point, scale_of, derivative, differentiate

  !> Differences that change by less when their step is quartered are taken as they are; divisions tried otherwise.
  real(wp), parameter :: smooth = 1e-6_wp
  integer, parameter :: most_divisions = 7

contains

  !> Image of a section point (its coordinates, SI) after `periods` drive periods and what happened on the
  !> way; `ok` is false if the trajectory had to be given up. `duration` [s] is the time that it took.
  pure subroutine map_point(moving, point, periods, image, tally, ok, needs_v_max, duration)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: periods
    real(wp), intent(out) :: image(:)
    type(tally_t), intent(out) :: tally
    logical, intent(out) :: ok
    logical, intent(in), optional :: needs_v_max
    real(wp), intent(out), optional :: duration
    type(section_state_t) :: section
    real(wp) :: reached(most_coordinates)
    integer :: i, reason
    section = moving%state_at(point)
    if (present(needs_v_max)) tally%needs_v_max = needs_v_max
    call moving%begin_tally(section, tally)
    reason = 0
    if (present(duration)) duration = 0
    do i = 1, periods
      call moving%advance_to_section(section, tally, reason)
      if (present(duration)) duration = duration + section%lasted
      if (reason /= 0) exit
    end do
    reached = moving%point_of(section)
    image = reached(:size(image))
    ok = reason == 0
  end subroutine map_point

  !> Scales of the coordinates, from half the range of the position.
  pure function scale_of(moving, tally) result(scale)
    class(machine_t), intent(in) :: moving
    type(tally_t), intent(in) :: tally
    real(wp) :: scale(most_coordinates)
    scale = max(moving%scales(max((tally%x_max - tally%x_min)/2, moving%smallest_motion)), tiny(1.0_wp))
  end function scale_of

  !> Scaled derivative of P^period, by variations where they are known: not of a motion from turn to turn, under a measured force,
  !> and of the laws that `why_not_varied` names. There it is by differences. Next to a graze the map is linear only in a range that
  !> shrinks like the square of the impact speed: where a quarter of their step gives another result, it is divided on until the
  !> results agree best.
  pure subroutine derivative(moving, point, period, scale, jacobian, ok)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: point(:), scale(:)
    integer, intent(in) :: period
    real(wp), intent(out) :: jacobian(:, :)
    logical, intent(out) :: ok
    real(wp), dimension(size(point), size(point)) :: coarse, fine
    real(wp) :: share, best, change
    integer :: k
    call slopes_of(moving, point, period, scale, jacobian, ok)
    if (ok) return
    share = 1
    best = huge(best)
    call differentiate(moving, point, period, scale, coarse, ok)
    jacobian = coarse
    do k = 1, most_divisions
      if (.not. ok) return
      share = share/4
      call differentiate(moving, point, period, scale, fine, ok, share)
      if (.not. ok) return
      change = norm2(fine - coarse)
      if (k == 1 .and. change <= smooth*max(1.0_wp, norm2(coarse))) return
      if (change < best) jacobian = fine
      best = min(best, change)
      coarse = fine
    end do
  end subroutine derivative

  !> Scaled derivative of P^period by central differences over `share` of the usual step; one-sided at a barrier.
  pure subroutine differentiate(moving, point, period, scale, jacobian, ok, share)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: point(:), scale(:)
    integer, intent(in) :: period
    real(wp), intent(out) :: jacobian(:, :)
    logical, intent(out) :: ok
    real(wp), intent(in), optional :: share
    real(wp), dimension(size(point)) :: ahead, behind, image_ahead, image_behind
    real(wp) :: h
    type(tally_t) :: tally
    integer :: k
    h = epsilon(1.0_wp)**(1.0_wp/3.0_wp)
    if (present(share)) h = share*h
    do k = 1, size(point)
      ahead = point
      behind = point
      ahead(k) = ahead(k) + h*scale(k)
      behind(k) = behind(k) - h*scale(k)
      ahead(1) = min(ahead(1), moving%upper)
      behind(1) = max(behind(1), moving%lower)
      call map_point(moving, ahead, period, image_ahead, tally, ok)
      if (.not. ok) return
      call map_point(moving, behind, period, image_behind, tally, ok)
      if (.not. ok) return
      image_ahead = point_near(image_ahead, image_behind, moving%turn_on_section())
      jacobian(:, k) = (image_ahead - image_behind)/scale/((ahead(k) - behind(k))/scale(k))
    end do
  end subroutine differentiate

end module section_map
