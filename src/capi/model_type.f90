! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a handle of the C interface stands for: a case and the list of its numbers.
module model_type
  use build_pair, only: is_pair, parts_of_pair
  use case_echo, only: echo_case
  use case_parameters, only: canonical_name
  use case_reader, only: load_case, load_case_text
  use case_setup, only: options_of
  use case_type, only: case_t, drive_law
  use case_values, only: allowed_range, bounds_t
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: effect_family, find_law, law_choice, law_choice_t, law_names, parameter_row_t, parameters_of, set_value
  use motion_state, only: options_t
  use parameter_list, only: list_parameters, parameter_t, put_values
  use status, only: exit_bad_case, exit_usage
  use suggest, only: nearest_word
  use text, only: join, to_text
  implicit none
  private

  public :: read_model, model_from_text, find_parameter, check_values, laws_with_force, model_options, text_with, &
    model_with_effect, model_written_out

  type, public :: model_t
    type(case_t) :: the_case
    type(parameter_t), allocatable :: parameters(:)
  end type model_t

contains

  !> The model of the case file `path`. Code 66: it cannot be read; 65: anything wrong in it.
  subroutine read_model(path, model, error)
    character(len=*), intent(in) :: path
    type(model_t), intent(out) :: model
    type(error_t), allocatable, intent(out) :: error
    character(len=1) :: no_overrides(0)
    call load_case(path, no_overrides, model%the_case, error, needs_sweep=.false.)
    if (.not. allocated(error)) model%parameters = list_parameters(model%the_case%laws)
  end subroutine read_model

  !> The model of a case in memory; `directory` is where the files that it names are. Code 65.
  subroutine model_from_text(text, directory, model, error)
    character(len=*), intent(in) :: text, directory
    type(model_t), intent(out) :: model
    type(error_t), allocatable, intent(out) :: error
    character(len=1) :: no_overrides(0)
    character(len=:), allocatable :: name
    name = 'case'
    if (len(directory) > 0) name = directory//'/case'
    call load_case_text(text, name, no_overrides, model%the_case, error, needs_sweep=.false.)
    if (.not. allocated(error)) model%parameters = list_parameters(model%the_case%laws)
  end subroutine model_from_text

  !> Position of the parameter `path`, from 1. Code 65 if there is none.
  subroutine find_parameter(model, path, position, error)
    type(model_t), intent(in) :: model
    character(len=*), intent(in) :: path
    integer, intent(out) :: position
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: meant
    position = findloc(model%parameters%path == canonical_name(path), .true., dim=1)
    if (position > 0) return
    meant = nearest_word(path, model%parameters%path)
    if (len(meant) > 0) meant = ' (did you mean '''//meant//'''?)'
    call fail(error, exit_bad_case, model%the_case%path//': parameter '''//path//''': unknown'//meant//'; allowed '// &
              join(model%parameters%path, ', '))
  end subroutine find_parameter

  !> Whether `chosen` are positions in the list, each once (code 64), and `values` within their bounds (code 65).
  subroutine check_values(model, chosen, values, error)
    type(model_t), intent(in) :: model
    integer, intent(in) :: chosen(:)
    real(wp), intent(in) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: problem
    integer :: i
    do i = 1, size(chosen)
      if (chosen(i) < 1 .or. chosen(i) > size(model%parameters)) then
        call fail(error, exit_usage, 'parameter index: found '//to_text(chosen(i) - 1)//', allowed 0 to '// &
                  to_text(size(model%parameters) - 1))
        return
      end if
      associate (one => model%parameters(chosen(i)))
        if (any(chosen(:i - 1) == chosen(i))) then
          call fail(error, exit_usage, 'parameter '''//trim(one%path)//''': chosen twice')
          return
        end if
        problem = allowed_range(values(i), bounds_t(one%lower, one%upper, one%lower_open, one%unit))
        if (len(problem) == 0) cycle
        call fail(error, exit_bad_case, model%the_case%path//': parameter '''//trim(one%path)//''': '//problem)
        return
      end associate
    end do
  end subroutine check_values

  !> The laws of the case with another measured force, `force` [N] every `interval` [s]; none of them leaves it as it is.
  !> Code 64 if the case has no measured force.
  subroutine laws_with_force(model, interval, force, laws, error)
    type(model_t), intent(in) :: model
    real(wp), intent(in) :: interval, force(:)
    type(law_choice_t), allocatable, intent(out) :: laws(:)
    type(error_t), allocatable, intent(out) :: error
    laws = model%the_case%laws
    if (size(force) == 0) return
    if (laws(drive_law)%name /= 'measured_force') then
      call fail(error, exit_usage, model%the_case%path//': force: given with drive.law = "'//trim(laws(drive_law)%name)// &
                '", allowed with "measured_force"')
    else if (size(force) < 2 .or. .not. all(abs(force) <= huge(force))) then
      call fail(error, exit_usage, 'force: found '//to_text(size(force))//' samples, allowed two or more, finite')
    else if (.not. (interval > 0 .and. interval <= huge(interval))) then
      call fail(error, exit_usage, 'force: found an interval of '//to_text(interval)//' s, allowed more than 0')
    else
      call set_value(laws(drive_law), 'interval', [interval])
      call set_value(laws(drive_law), 'force', force)
      ! A record from its first sample to its last, however that of the case repeats.
      call set_value(laws(drive_law), 'periodic', [0.0_wp])
    end if
  end subroutine laws_with_force

  !> Integrator options of the case with another `tolerance` of the adaptive flight.
  function model_options(model, tolerance) result(options)
    type(model_t), intent(in) :: model
    real(wp), intent(in) :: tolerance
    type(options_t) :: options
    options = options_of(model%the_case)
    options%tolerance = tolerance
  end function model_options

  !> The resolved case with other values. Code 65 if together they make no valid case.
  subroutine text_with(model, chosen, values, text, error)
    type(model_t), intent(in) :: model
    integer, intent(in) :: chosen(:)
    real(wp), intent(in) :: values(:)
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(out) :: error
    type(case_t) :: changed, read_back
    character(len=1) :: no_overrides(0)
    changed = model%the_case
    call put_values(changed%laws, model%parameters(chosen), values)
    text = echo_case(changed)
    call load_case_text(text, model%the_case%path, no_overrides, read_back, error)
  end subroutine text_with

  !> The model with the effect `name` added, of which `keys` have `values`; the others take their defaults. Code 65 if there is
  !> no such effect, it is there already, a parameter is unknown or missing, or together they make no valid case.
  subroutine model_with_effect(model, name, keys, values, extended, error)
    type(model_t), intent(in) :: model
    character(len=*), intent(in) :: name, keys(:)
    real(wp), intent(in) :: values(:)
    type(model_t), intent(out) :: extended
    type(error_t), allocatable, intent(out) :: error
    type(parameter_row_t), allocatable :: rows(:)
    type(law_choice_t) :: added
    type(case_t) :: changed
    character(len=1) :: no_overrides(0)
    integer :: i
    if (find_law(effect_family, name) == 0) then
      call fail(error, exit_bad_case, 'effect '''//name//''': unknown; allowed '//law_names(effect_family))
      return
    end if
    if (any(model%the_case%laws%family == effect_family .and. model%the_case%laws%name == name)) then
      call fail(error, exit_bad_case, model%the_case%path//': effect '''//name//''': the case has it already')
      return
    end if
    rows = parameters_of(effect_family, name)
    do i = 1, size(keys)
      if (any(rows%name == name_of(keys(i)))) cycle
      call fail(error, exit_bad_case, 'effect.'//name//': parameter '''//trim(keys(i))//''': unknown; allowed '// &
                join(rows%name, ', '))
      return
    end do
    added = law_choice(effect_family, name)
    do i = 1, size(rows)
      if (any(name_of(keys) == rows(i)%name)) then
        call set_value(added, trim(rows(i)%name), pack(values, name_of(keys) == rows(i)%name))
      else if (.not. rows(i)%optional) then
        call fail(error, exit_bad_case, 'effect.'//name//': '''//trim(rows(i)%name)//''' is missing')
        return
      end if
    end do
    changed = model%the_case
    changed%laws = [changed%laws, added]
    call load_case_text(echo_case(changed), model%the_case%path, no_overrides, extended%the_case, error)
    if (.not. allocated(error)) extended%parameters = list_parameters(extended%the_case%laws)
  end subroutine model_with_effect

  !> The model of a pair with its bodies, joints and drive in tables of their own, without axes, sweep and derived quantities,
  !> which name keys of the short form. Code 64 without a pair, 65 where the driving body moves on at a constant velocity: no
  !> table has that.
  subroutine model_written_out(model, longer, error)
    type(model_t), intent(in) :: model
    type(model_t), intent(out) :: longer
    type(error_t), allocatable, intent(out) :: error
    type(case_t) :: changed
    character(len=1) :: no_overrides(0)
    associate (laws => model%the_case%laws)
      if (.not. is_pair(laws)) then
        call fail(error, exit_usage, model%the_case%path//': body.law: found "'//trim(laws(1)%name)// &
                  '", allowed friction_pair, backlash_pair')
        return
      else if (laws(drive_law)%name == 'velocity' .or. laws(drive_law)%name == 'pid_velocity') then
        call fail(error, exit_bad_case, model%the_case%path//': drive.law: found "'//trim(laws(drive_law)%name)// &
                  '", allowed where a pair is written out none, force, sine, pid_sine')
        return
      end if
    end associate
    changed = model%the_case
    changed%laws = parts_of_pair(model%the_case%laws)
    if (allocated(changed%axes)) deallocate (changed%axes)
    allocate (changed%axes(0))
    if (allocated(changed%sample%names)) deallocate (changed%sample%names)
    allocate (changed%sample%names(0))
    changed%sweep%present = .false.
    changed%refine%active = .false.
    if (allocated(changed%derived)) deallocate (changed%derived)
    call load_case_text(echo_case(changed), model%the_case%path, no_overrides, longer%the_case, error, needs_sweep=.false.)
    if (.not. allocated(error)) longer%parameters = list_parameters(longer%the_case%laws)
  end subroutine model_written_out

  !> Name of a parameter without its index in a list: 'change' of 'change[2]'. Items are given in their order.
  pure elemental function name_of(key) result(name)
    character(len=*), intent(in) :: key
    character(len=len(key)) :: name
    name = key(:index(key//'[', '[') - 1)
  end function name_of

end module model_type
