! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> From a case file (docs/case-file.md) to a case. Every problem of a file is reported at once, a
!> line each: `FILE:LINE: key 'friction.damping': found ..., allowed ...`.
module case_reader
  use angle_units, only: unit_of
  use assumptions, only: assumed_by_default
  use attractors, only: longest_period
  use axis, only: name_length
  use axis_reader, only: read_axes, read_sweep
  use case_check, only: check_case
  use case_echo, only: echo_case
  use case_source, only: assume, case_source_t, enter_table, open_source, origin_of, problems_of, report_unknown
  use case_type, only: case_t
  use case_values, only: any_number, at_least, between, more_than, take_choice, take_integer, take_real, take_text
  use derived_reader, only: check_derived, read_derived
  use errors, only: error_t
  use kinds, only: wp
  use law_reader, only: read_laws
  use law_table, only: largest_angle
  use restoring_law, only: position_is_angle
  use sample_reader, only: read_samples
  use slip_reader, only: write_out_slip
  use structure_data, only: structure_file_reader
  use refinement, only: largest_block, largest_step, most_probes
  use toml_bindings, only: read_text_file
  implicit none
  private

  !> Most starts of a second look for attractors.
  integer, parameter :: most_starts = 1000000

  public :: load_case, load_case_text

contains

  !> Reads the file `path`, puts the overrides ('key.path=value' in TOML syntax, blank-padded) on top
  !> and validates. Code 66: the file cannot be read; 65: anything wrong in it. With `needs_sweep` false a table [sweep] that
  !> lacks what a sweep needs is left out. `structure_file` reads HDF5 files of structures.
  subroutine load_case(path, overrides, the_case, error, needs_sweep, structure_file)
    character(len=*), intent(in) :: path, overrides(:)
    type(case_t), intent(out) :: the_case
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: needs_sweep
    procedure(structure_file_reader), optional :: structure_file
    character(len=:), allocatable :: text
    call read_text_file(path, text, error)
    if (allocated(error)) return
    call load_case_text(text, path, overrides, the_case, error, needs_sweep, structure_file)
  end subroutine load_case

  !> The same for a text that is already in memory; `name` stands for the file in messages.
  subroutine load_case_text(text, name, overrides, the_case, error, needs_sweep, structure_file)
    character(len=*), intent(in) :: text, name, overrides(:)
    type(case_t), intent(out) :: the_case
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: needs_sweep
    procedure(structure_file_reader), optional :: structure_file
    type(case_source_t) :: source
    the_case%path = name
    the_case%raw_text = text
    the_case%title = ''
    if (present(needs_sweep)) the_case%sweep%wanted = needs_sweep
    call open_source(source, text, name, overrides, error)
    if (allocated(error)) return
    if (present(structure_file)) source%structure_file => structure_file
    call take_text(source, 'title', the_case%title)
    call write_out_slip(source)
    call read_laws(source, the_case%laws)
    call read_start(source, the_case)
    call read_run(source, the_case)
    call read_integrator(source, the_case)
    call read_attractors(source, the_case)
    call read_axes(source, the_case)
    call read_samples(source, the_case)
    call read_refine(source, the_case)
    call read_sweep(source, the_case)
    call read_trajectory(source, the_case)
    call read_record(source, the_case)
    call read_derived(source, the_case)
    call report_unknown(source)
    call check_case(source, the_case)
    if (size(source%problems) == 0) call check_derived(source, the_case)
    call problems_of(source, error)
    if (allocated(error)) return
    the_case%resolved_text = echo_case(the_case)
    call assume(source, assumed_by_default(source, the_case%laws, [character(len=name_length) :: the_case%axes%name]))
    the_case%assumed = source%assumed
  end subroutine load_case_text

  subroutine read_start(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(inout) :: the_case
    logical :: found
    call enter_table(source, 'start', found)
    the_case%start%origin = origin_of(source, 'start.x0')
    associate (start => the_case%start)
      associate (is_angle => position_is_angle(the_case%laws))
        call take_real(source, 'start.x0', any_number(unit_of('m', is_angle)), start%x0)
        call take_real(source, 'start.v0', any_number(unit_of('m/s', is_angle)), start%v0)
      end associate
      call take_real(source, 'start.crank_angle', between(-largest_angle, largest_angle, 'rad'), start%crank_angle)
    end associate
  end subroutine read_start

  subroutine read_run(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(inout) :: the_case
    logical :: found
    call enter_table(source, 'run', found)
    associate (run => the_case%run)
      call take_real(source, 'run.duration', more_than(0.0_wp, 's'), run%duration)
      run%window = run%duration/4
      call take_real(source, 'run.window', more_than(0.0_wp, 's'), run%window)
      call take_choice(source, 'run.average', ['whole_periods', 'window       '], run%average)
      call take_choice(source, 'run.stop', ['captured', 'duration'], run%stop)
      call take_real(source, 'run.extension', at_least(1.0_wp, '1'), run%extension)
      call take_real(source, 'run.domain', more_than(0.0_wp, 'm'), run%domain)
    end associate
  end subroutine read_run

  subroutine read_integrator(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(inout) :: the_case
    logical :: found
    call enter_table(source, 'integrator', found)
    associate (integrator => the_case%integrator)
      call take_choice(source, 'integrator.flight', ['auto    ', 'exact   ', 'adaptive'], integrator%flight)
      call take_choice(source, 'integrator.lanes', ['auto', 'off '], integrator%lanes)
      call take_real(source, 'integrator.tolerance', between(1e-15_wp, 1e-3_wp, '1'), integrator%tolerance)
      call take_integer(source, 'integrator.event_budget', 1, integrator%event_budget)
      call take_integer(source, 'integrator.step_budget', 1, integrator%step_budget)
    end associate
  end subroutine read_integrator

  subroutine read_attractors(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(inout) :: the_case
    logical :: found
    call enter_table(source, 'attractors', found)
    associate (attractors => the_case%attractors)
      call take_integer(source, 'attractors.sample', 1, attractors%sample)
      call take_integer(source, 'attractors.seed', 0, attractors%seed)
      call take_integer(source, 'attractors.max_period', 1, attractors%max_period, highest=longest_period)
      call take_integer(source, 'attractors.second_look', 0, attractors%second_look, highest=most_starts)
    end associate
  end subroutine read_attractors

  subroutine read_refine(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(inout) :: the_case
    call enter_table(source, 'refine', the_case%refine%active)
    associate (refine => the_case%refine)
      call take_integer(source, 'refine.step', 2, refine%step, highest=largest_step)
      call take_integer(source, 'refine.block', 0, refine%block, highest=largest_block)
      call take_real(source, 'refine.contrast', more_than(0.0_wp, '1'), refine%contrast)
      call take_integer(source, 'refine.contrast_side', 1, refine%contrast_side)
      call take_integer(source, 'refine.probes', 1, refine%probes, highest=most_probes)
      call take_integer(source, 'refine.seed', 0, refine%seed)
    end associate
  end subroutine read_refine

  subroutine read_trajectory(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(inout) :: the_case
    logical :: found
    call enter_table(source, 'trajectory', found)
    call take_integer(source, 'trajectory.samples_per_period', 2, the_case%trajectory%samples_per_period)
  end subroutine read_trajectory

  subroutine read_record(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(inout) :: the_case
    logical :: found
    call enter_table(source, 'record', found)
    associate (record => the_case%record)
      call take_real(source, 'record.rate', more_than(0.0_wp, 'Hz'), record%rate)
      call take_real(source, 'record.noise', at_least(0.0_wp, 'm'), record%noise)
      call take_real(source, 'record.resolution', at_least(0.0_wp, 'm'), record%resolution)
      call take_real(source, 'record.delay', at_least(0.0_wp, 's'), record%delay)
      call take_integer(source, 'record.seed', 0, record%seed)
    end associate
  end subroutine read_record

end module case_reader
