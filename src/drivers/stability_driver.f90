! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix stability`: Lyapunov exponents of the motion from [start], or of the entries of a map without a period, and what
!> kind of motion it is.
module stability_driver
  use body_family, only: family_t
  use case_check, only: require_start
  use case_setup, only: options_of
  use case_type, only: case_t
  use command_line, only: command_t
  use ending_text, only: why_json, why_not_known
  use endings, only: assess_motion
  use errors, only: error_t
  use exponents, only: most_points, motion_names, spectrum_t, type_of_motion, zero_one_test
  use files, only: file_exists, is_empty, is_special, is_text
  use journal, only: json_number, json_text
  use kinds, only: wp
  use machine_family, only: machine_neighbourhood
  use more_periods, only: periods_needed
  use session, only: open_session, session_t
  use stability_of_map, only: needed_text, run_stability_of_map, seen_text
  use status, only: exit_done, reason_name
  use structure_exponents, only: exponents_of_machine
  use text, only: replace_all, to_text
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: run_stability

contains

  !> Runs the command on a case, which ends the program, or on a map.
  subroutine run_stability(command, error)
    type(command_t), intent(in) :: command
    type(error_t), allocatable, intent(out) :: error
    if (is_map(command%path)) then
      call run_stability_of_map(command, error)
    else
      call run_stability_of_case(command)
    end if
  end subroutine run_stability

  !> Whether a path is that of a file in HDF5, not of a case: a regular file that is no text.
  logical function is_map(path)
    character(len=*), intent(in) :: path
    is_map = file_exists(path)
    if (is_map) is_map = .not. is_special(path)
    if (is_map) is_map = .not. is_text(path)
    if (is_map) is_map = .not. is_empty(path)
  end function is_map

  !> The motion of a case; ends the program with the exit code on errors.
  subroutine run_stability_of_case(command)
    type(command_t), intent(in) :: command
    type(session_t) :: session
    type(family_t) :: family
    type(neighbourhood_t) :: machines
    type(spectrum_t) :: spectrum
    type(error_t), allocatable :: error
    real(wp) :: section(min(most_points, command%periods)), k
    call open_session(command, session)
    call require_start(session%the_case, error)
    call session%stop_if(error)
    family%laws = session%the_case%laws
    family%options = options_of(session%the_case)
    call machine_neighbourhood(family, 0.0_wp, machines, error)
    call session%stop_if(error)
    if (command%validate .or. command%dry_run) then
      call session%journal%line('valid', command%path//' is a valid case for stability')
      call session%end_with(exit_done)
    end if
    if (session%team%is_root()) then
      associate (start => session%the_case%start)
        call exponents_of_machine(machines, [start%x0, start%v0, start%crank_angle], command%periods/4, command%periods, spectrum, &
                                  section)
      end associate
      if (spectrum%known) then
        k = zero_one_test(section)
        call report(session, spectrum, machines%centre%has_clock, k)
      else
        call session%journal%line('not_known', 'not known: '//why_not_known(spectrum, session%the_case%laws), &
                                  '"known": false'//why_json(spectrum))
      end if
      call assess_motion(spectrum%reason, reason_name(spectrum%reason), command%partial, error)
    end if
    call session%stop_if(error)
    call session%end_with(exit_done)
  end subroutine run_stability_of_case

  !> What was found, with errors and the check.
  subroutine report(session, spectrum, has_clock, k)
    type(session_t), intent(inout) :: session
    type(spectrum_t), intent(in) :: spectrum
    logical, intent(in) :: has_clock
    real(wp), intent(in) :: k
    character(len=:), allocatable :: name, what, more
    integer :: i
    do i = 1, size(spectrum%exponents)
      associate (value => spectrum%exponents(i), error => spectrum%errors(i))
        if (value < -huge(1.0_wp)/2) then
          call session%journal%line('exponent', 'Lyapunov exponent '//to_text(i)//': -inf (a direction is lost: sticking, '// &
                                    'completed chatter, impacts without rebound, or, of a motor, a held integral or a fast '// &
                                    'current)', '"number": '//to_text(i)//', "value": null')
        else
          more = ', standard error '//to_text(error, 2)
          if (spectrum%by_multipliers) more = ', by the multipliers'
          call session%journal%line('exponent', 'Lyapunov exponent '//to_text(i)//': '//to_text(value, 6)//' 1/s'//more, &
            '"number": '//to_text(i)//', "value": '//json_number(value)//', "error": '//json_number(error))
        end if
      end associate
    end do
    if (.not. has_clock) call session%journal%line('trivial', 'and the trivial exponent 0 of an autonomous machine; the '// &
      'section is crossed every '//to_text(spectrum%mean_period, 10)//' s', '"mean_period": '//json_number(spectrum%mean_period))
    if (spectrum%has_sum) then
      call session%journal%line('sum', 'their sum: '//to_text(spectrum%sum_found, 10)//' 1/s; exact, from damping, impacts and '// &
        'turning points: '//to_text(spectrum%sum_exact, 10)//' 1/s', '"found": '//json_number(spectrum%sum_found)// &
        ', "exact": '//json_number(spectrum%sum_exact))
    end if
    call session%journal%line('zero_one', '0-1 test: '//to_text(k, 3)//' (0 regular, 1 chaotic)', '"value": '//json_number(k))
    more = ''
    if (periods_needed(spectrum, k) > 0) more = ', "periods_needed": '//to_text(periods_needed(spectrum, k))
    name = trim(motion_names(type_of_motion(spectrum, k)))
    what = 'is '//replace_all(replace_all(name, 'not_known', 'not known'), '_', '-')
    if (spectrum%at_rest) what = 'comes to rest'
    if (spectrum%drifts) what = 'is not known: its position comes back, and a state drifts'
    call session%journal%line('motion', 'the motion '//what//', '//seen_text(spectrum, has_clock)//needed_text(spectrum, k), &
      '"type": '//json_text(name)//', "periods": '//to_text(spectrum%periods)//', "impacts": '//to_text(spectrum%impacts)//more)
  end subroutine report

end module stability_driver
