! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Homoclinic contacts and boundary crises among the labelled points of the branches.
module branch_contacts
  use branch_point, only: label_crisis, label_homoclinic, point_t
  use search_state, only: search_t
  use errors, only: error_t
  use homoclinic, only: contact_t, find_contacts, starts_that_stay
  use journal, only: json_number, json_text
  use kinds, only: int64, wp
  use machine_family, only: machine_neighbourhood
  use periodic_orbit, only: correct_orbit
  use orbit_directions, only: direct
  use session, only: session_t
  use text, only: to_text
  use variations, only: neighbourhood_t
  implicit none
  private

  !> The saddle of a contact is known at its bracket, the orbit at its one end; of natural sizes.
  real(wp), parameter :: same_orbit = 1e-3_wp

  public :: contacts_t, look_for_contacts, report_contacts

  !> The contacts of all branches, with the number of the branch and of the point there (0: the orbit was not to be had).
  type :: contacts_t
    type(contact_t), allocatable :: list(:)
    integer, allocatable :: branch(:), point(:)
  end type contacts_t

contains

  !> Looks for contacts along every branch and puts a labelled point there.
  subroutine look_for_contacts(session, search, contacts)
    type(session_t), intent(inout) :: session
    type(search_t), intent(inout) :: search
    type(contacts_t), intent(out) :: contacts
    type(contact_t), allocatable :: found(:)
    type(point_t) :: point
    integer :: b, k, at, before
    logical :: ok
    allocate (contacts%list(0), contacts%branch(0), contacts%point(0))
    call session%journal%begin('branches', int(size(search%branches), int64), 0_int64)
    do b = 1, size(search%branches)
      call find_contacts(search%family, search%branches(b)%points, found)
      before = 0
      do k = 1, size(found)
        at = found(k)%after + before
        call point_at(search, search%branches(b)%points(at:at + 1), found(k), point, ok)
        contacts%point = [contacts%point, merge(at + 1, 0, ok)]
        if (ok) call insert(point, at, search%branches(b)%points)
        if (ok) before = before + 1
        contacts%list = [contacts%list, found(k)]
        contacts%branch = [contacts%branch, b]
      end do
      call session%journal%progress(int(b, int64))
    end do
  end subroutine look_for_contacts

  !> Puts a point behind one of a line.
  subroutine insert(point, after, line)
    type(point_t), intent(in) :: point
    integer, intent(in) :: after
    type(point_t), allocatable, intent(inout) :: line(:)
    type(point_t), allocatable :: longer(:)
    allocate (longer(size(line) + 1))
    longer(:after) = line(:after)
    longer(after + 1) = point
    longer(after + 2:) = line(after + 1:)
    call move_alloc(longer, line)
  end subroutine insert

  !> The point of a branch where a contact is, between two of its points.
  subroutine point_at(search, pair, contact, point, ok)
    type(search_t), intent(in) :: search
    type(point_t), intent(in) :: pair(2)
    type(contact_t), intent(in) :: contact
    type(point_t), intent(out) :: point
    logical, intent(out) :: ok
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    integer :: i
    ok = .false.
    call machine_neighbourhood(search%family, contact%reach, machines, error)
    if (allocated(error)) return
    do i = 1, 2
      point = pair(i)
      point%orbit%parameter = contact%reach
      call correct_orbit(search%family, machines, point%orbit, direct(point%orbit, 1), ok)
      if (ok) ok = norm2((point%orbit%y - contact%y)/machines%centre%size_of) < same_orbit
      if (ok) exit
    end do
    point%label = merge(label_crisis, label_homoclinic, contact%crisis)
  end subroutine point_at

  !> What was seen beside the saddle on both sides of the contacts at a point of a branch, or (0) of those without a point.
  subroutine report_contacts(session, search, contacts, branch, point, unit)
    type(session_t), intent(inout) :: session
    type(search_t), intent(in) :: search
    type(contacts_t), intent(in) :: contacts
    integer, intent(in) :: branch, point
    character(len=*), intent(in) :: unit
    character(len=:), allocatable :: shown
    integer :: k
    do k = 1, size(contacts%list)
      if (contacts%branch(k) /= branch .or. contacts%point(k) /= point) cycle
      associate (contact => contacts%list(k))
        shown = 'between '//to_text(contact%reach, 9)//' and '//to_text(contact%stay, 9)
        if (unit /= '1') shown = shown//' '//unit
        shown = shown//': on the side of the first, starts on either side of the saddle reach the attractor of period '// &
          to_text(contact%period)//'; on that of the second none of '//to_text(starts_that_stay)//' on one side does'
        if (contact%crisis) shown = shown//', and their motion is chaotic'
        call session%journal%line('contact', '    '//shown, '"branch": '//to_text(branch)//', "parameter": '// &
          json_text(search%family%path)//', "reach": '//json_number(contact%reach)//', "stay": '//json_number(contact%stay)// &
          ', "crisis": '//trim(merge('true ', 'false', contact%crisis)))
      end associate
    end do
  end subroutine report_contacts

end module branch_contacts
