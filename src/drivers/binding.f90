! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> On which cores the ranks of each host run: one line a host in the log, and a warning where ranks are in each
!> other's way.
module binding
  use journal, only: journal_t, json_text
  use kinds, only: wp
  use system, only: core_list, core_quota, host_name, may_use_core, online_cores
  use team, only: host_length, team_t
  use text, only: to_text
  implicit none
  private

  public :: report_binding

contains

  !> Queries every rank, and reports on rank 0; in plain text only for several ranks. Collective.
  subroutine report_binding(team, journal)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    character(len=host_length), allocatable :: names(:)
    real(wp), allocatable :: hosts(:), masks(:), all_cores(:), quotas(:)
    character(len=host_length) :: mine
    integer :: cores, host, i
    mine = host_name()
    call team%hosts(mine, names)
    call team%gather([real(findloc(names == mine, .true., dim=1), wp)], hosts)
    cores = online_cores()
    call team%gather([real(cores, wp)], all_cores)
    call team%gather([core_quota()], quotas)
    ! Ranks may have hosts of different size: the largest decides how many cores are asked for.
    call team%allgather([real(cores, wp)], masks)
    cores = nint(maxval(masks))
    call team%gather([(merge(1.0_wp, 0.0_wp, may_use_core(i)), i=0, cores - 1)], masks)
    if (.not. team%is_root()) return
    do host = 1, size(names)
      call report_host(journal, trim(names(host)), pack([(i, i=1, size(hosts))], nint(hosts) == host), &
                       reshape(masks, [cores, size(hosts)]) > 0.5_wp, nint(all_cores), quotas)
    end do
  end subroutine report_binding

  !> `allowed(core, rank)`; `ranks` are those of the host, from 1; `quotas`: cores whose time a rank's control group allows.
  subroutine report_host(journal, name, ranks, allowed, all_cores, quotas)
    type(journal_t), intent(inout) :: journal
    character(len=*), intent(in) :: name
    integer, intent(in) :: ranks(:), all_cores(:)
    logical, intent(in) :: allowed(:, :)
    real(wp), intent(in) :: quotas(:)
    character(len=:), allocatable :: lists, warning
    logical :: bound
    integer :: i
    lists = ''
    do i = 1, size(ranks)
      if (i > 1) lists = lists//'; '
      lists = lists//to_text(ranks(i) - 1)//': '//range_text(allowed(:, ranks(i)))
    end do
    bound = any(count(allowed(:, ranks), dim=1) < all_cores(ranks(1)))
    call journal%line('binding', 'host '//name//': '//to_text(size(ranks))//' ranks on '//to_text(all_cores(ranks(1)))// &
      ' cores; rank: cores '//lists, '"host": '//json_text(name)//', "ranks": '//to_text(size(ranks))// &
      ', "cores": '//to_text(all_cores(ranks(1)))//', "bound": '//to_text(bound)//', "rank_cores": '//json_text(lists), &
      plain=size(all_cores) > 1)
    warning = conflict(allowed(:, ranks))
    if (len(warning) == 0 .and. minval(quotas(ranks)) < size(ranks)) warning = 'the control group of a rank allows the '// &
      'processor time of '//to_text(minval(quotas(ranks)), 2)//' cores, to '//to_text(size(ranks))//' ranks'
    if (len(warning) > 0) call journal%line('warning', 'warning: host '//name//': '//warning, '"host": '//json_text(name))
  end subroutine report_host

  !> What slows ranks down, '' if nothing: fewer cores than ranks, or two ranks bound to the same core.
  pure function conflict(allowed) result(words)
    logical, intent(in) :: allowed(:, :)
    character(len=:), allocatable :: words
    integer :: ranks, cores
    words = ''
    ranks = size(allowed, 2)
    cores = count(any(allowed, dim=2))
    if (ranks == 1 .or. cores == 0) return
    if (cores == 1) then
      words = 'all '//to_text(ranks)//' ranks are bound to core '//range_text(any(allowed, dim=2))//'; see the binding '// &
              'options of mpirun or srun'
    else if (cores < ranks) then
      words = to_text(ranks)//' ranks share '//to_text(cores)//' cores'
    else if (any_shared(allowed)) then
      words = 'two ranks are bound to the same core'
    end if
  end function conflict

  !> Whether a core is the only one of two ranks.
  pure logical function any_shared(allowed)
    logical, intent(in) :: allowed(:, :)
    integer :: owners(size(allowed, 1)), i
    owners = 0
    do i = 1, size(allowed, 2)
      if (count(allowed(:, i)) == 1) owners = owners + merge(1, 0, allowed(:, i))
    end do
    any_shared = any(owners > 1)
  end function any_shared

  !> '0-3,8'.
  pure function range_text(allowed) result(words)
    logical, intent(in) :: allowed(:)
    character(len=:), allocatable :: words
    integer :: first, last
    words = ''
    first = 1
    do while (first <= size(allowed))
      last = first
      if (allowed(first)) then
        do while (last < size(allowed))
          if (.not. allowed(last + 1)) exit
          last = last + 1
        end do
        if (len(words) > 0) words = words//','
        words = words//to_text(first - 1)
        if (last > first) words = words//'-'//to_text(last - 1)
      end if
      first = last + 1
    end do
  end function range_text

end module binding
