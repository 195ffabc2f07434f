! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A motion as a sensor would have measured it: delayed, sampled, scaled, noisy, quantised; a table that looks like a record.
module record_writer
  use case_type, only: case_t, record_t
  use constants, only: two_pi
  use effect_law, only: observed
  use elementary, only: logarithm, sine_cosine
  use errors, only: error_t, fail
  use kinds, only: int64, real64, wp
  use machine_type, only: machine_t
  use random, only: uniform
  use sampling, only: sample_positions
  use status, only: exit_bad_case, exit_given_up, is_given_up, reason_name
  use text, only: to_text
  use text_table, only: table_t
  implicit none
  private

  public :: write_record

contains

  !> Writes the motion of a case from `start` = x0 [m], v0 [m/s], crank angle [rad] into the table `path`.
  subroutine write_record(path, the_case, moving, start, error)
    character(len=*), intent(in) :: path
    type(case_t), intent(in) :: the_case
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: start(3)
    type(error_t), allocatable, intent(out) :: error
    type(table_t) :: table
    real(wp), allocatable :: times(:), x(:), driver(:), second(:)
    character(len=*), parameter :: row_format = '(*(es23.16, :, ","))'
    character(len=3*24) :: row
    integer :: count, i, reason
    count = floor(the_case%run%duration*the_case%record%rate) + 1
    times = [(i/the_case%record%rate, i=0, count - 1)]
    allocate (x(count), driver(count))
    associate (sensor => moving%sensor)
      call sample_positions(moving, start, max(0.0_wp, times - (the_case%record%delay + sensor%delay)), x, driver, reason)
      x = observed(sensor, x)
    end associate
    if (reason /= 0) then
      call fail(error, merge(exit_given_up, exit_bad_case, is_given_up(reason)), 'record: the motion ended early: '// &
                reason_name(reason)//'; no record was written')
      return
    end if
    call measure(the_case%record, 0_int64, x)
    call measure(the_case%record, int(count, int64), driver)
    allocate (second(0))
    if (moving%has_driver) second = driver
    if (moving%sample_interval > 0) second = moving%force_at(start(3), times)
    call table%create(path)
    associate (heading => heading_of(the_case, moving, start))
      do i = 1, size(heading)
        call table%line(trim(heading(i)))
      end do
    end associate
    do i = 1, count
      if (size(second) > 0) then
        write (row, row_format) times(i), x(i), second(i)
      else
        write (row, row_format) times(i), x(i)
      end if
      call table%line(trim(row))
    end do
    call table%close(error)
  end subroutine write_record

  !> What the sensor and the start were, and the names of the columns.
  function heading_of(the_case, moving, start) result(lines)
    type(case_t), intent(in) :: the_case
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: start(3)
    character(len=80), allocatable :: lines(:)
    lines = [character(len=80) :: '# units: s, m', &
      '# sampling_rate_hz: '//to_text(the_case%record%rate), &
      '# sensor_noise_sigma_m: '//to_text(the_case%record%noise), &
      '# sensor_resolution_m: '//to_text(the_case%record%resolution), &
      '# sensor_delay_s: '//to_text(the_case%record%delay), &
      '# x0_m: '//to_text(start(1)), &
      '# v0_m_s: '//to_text(start(2)), &
      '# phase: '//to_text(start(3))]
    if (moving%drive_ratio > 0) then
      lines = [character(len=80) :: lines, '# drive_ratio: '//to_text(moving%drive_ratio)]
    end if
    if (moving%sample_interval > 0) then
      lines = [character(len=80) :: lines, 't,x,force']
    else
      lines = [character(len=80) :: lines, merge('t,x,driver_x', 't,x         ', moving%has_driver)]
    end if
  end function heading_of

  !> Adds the noise of the sensor and rounds to its resolution; `first` keeps signals apart.
  pure subroutine measure(record, first, signal)
    type(record_t), intent(in) :: record
    integer(int64), intent(in) :: first
    real(wp), intent(inout) :: signal(:)
    real(real64) :: pair(2)
    real(wp) :: sine, cosine
    integer :: i
    do i = 1, size(signal)
      if (record%noise > 0) then
        ! Box and Muller.
        call uniform(int(record%seed, int64), first + i, pair)
        call sine_cosine(two_pi*pair(2), sine, cosine)
        signal(i) = signal(i) + record%noise*sqrt(-2*logarithm(1 - pair(1)))*cosine
      end if
      if (record%resolution > 0) signal(i) = record%resolution*anint(signal(i)/record%resolution)
    end do
  end subroutine measure

end module record_writer
