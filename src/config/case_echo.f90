! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A case as text: TOML in SI units with every default filled in. Reading it back gives the same
!> case to the bit.
module case_echo
  use axis, only: axis_t, linear_values
  use case_type, only: case_t, sample_t, sweep_t
  use derived_quantities, only: derived_t, is_power
  use grid, only: sample_axis
  use kinds, only: wp
  use law_table, only: effect_family, is_hidden, label_length, law_choice_t, list_of, parameter_row_t, rows_of, part_family, &
    part_kind, part_law, path_of, text_of, value_of
  use refinement, only: refine_t
  use motor_choices, only: has_motor
  use text, only: to_text
  use toml_bindings, only: hash_text
  implicit none
  private

  public :: echo_case, case_identity

  character(len=1), parameter :: newline = new_line('a')
  !> Characters of a number with its comma and blank, at most.
  integer, parameter :: longest_number = 40

contains

  !> The resolved case.
  pure function echo_case(the_case) result(text)
    type(case_t), intent(in) :: the_case
    character(len=:), allocatable :: text
    integer :: i
    text = '# The resolved case: SI units, defaults filled in.'//newline
    if (len(the_case%title) > 0) text = text//'title = '//quoted(the_case%title)//newline
    text = text//deciding_text(the_case, '')
    do i = 1, size(the_case%laws)
      if (is_sensor(the_case%laws(i))) text = text//law_text(the_case%laws(i), the_case%laws)
    end do
    associate (record => the_case%record)
      text = text//newline//'[record]'//newline//line('rate', to_text(record%rate))//line('noise', to_text(record%noise))// &
             line('resolution', to_text(record%resolution))//line('delay', to_text(record%delay))// &
             line('seed', to_text(record%seed))
    end associate
    if (size(the_case%axes) > 0) then
      text = text//newline//'[grid]'//newline//'tile = '// &
             integers(pack(the_case%tile, the_case%axes%name /= sample_axis))//newline
      if (size(the_case%sample%names) > 0) text = text//line('samples', to_text(the_case%sample%count))// &
                                                  line('seed', to_text(the_case%sample%seed))
    end if
  end function echo_case

  !> Checksum of what decides the results: everything but the title, the sensor, the shape of the tiles, and what the command
  !> `kind` ('' = any) does not read.
  pure function case_identity(the_case, kind) result(identity)
    type(case_t), intent(in) :: the_case
    character(len=*), intent(in) :: kind
    character(len=16) :: identity
    identity = hash_text(deciding_text(the_case, kind))
  end function case_identity

  pure function deciding_text(the_case, kind) result(text)
    type(case_t), intent(in) :: the_case
    character(len=*), intent(in) :: kind
    character(len=:), allocatable :: text
    integer :: i
    text = ''
    do i = 1, size(the_case%laws)
      if (.not. is_sensor(the_case%laws(i)) .and. is_written(the_case, i)) text = text//law_text(the_case%laws(i), &
                                                                                                     the_case%laws)
    end do
    text = text//settings_text(the_case)
    if (kind == '' .or. kind == 'trajectory') text = text//newline//'[trajectory]'//newline// &
      line('samples_per_period', to_text(the_case%trajectory%samples_per_period))
    do i = 1, size(the_case%axes)
      if (kind /= '' .and. kind /= 'basin') exit
      if (the_case%axes(i)%name == sample_axis) then
        text = text//samples_text(the_case%sample)
        cycle
      end if
      text = text//newline//'[[axis]]'//newline//line('name', quoted(trim(the_case%axes(i)%name)))// &
             values_text(the_case%axes(i)%values)
    end do
    if (allocated(the_case%derived)) text = text//derived_text(the_case%derived)
    if (the_case%refine%active) text = text//refine_text(the_case%refine)
    if (the_case%sweep%present .and. (kind == '' .or. kind == 'sweep')) text = text//sweep_text(the_case%sweep)
  end function deciding_text

  !> The tables [derived.NAME].
  pure function derived_text(derived) result(text)
    type(derived_t), intent(in) :: derived(:)
    character(len=:), allocatable :: text
    integer :: i
    text = ''
    do i = 1, size(derived)
      text = text//newline//'[derived.'//trim(derived(i)%name)//']'//newline//line('quantity', quoted(trim(derived(i)%quantity)))
      if (is_power(derived(i))) then
        text = text//line('of', quoted(derived(i)%expression))
      else
        text = text//line('expression', quoted(derived(i)%expression))//line('unit', quoted(derived(i)%unit))
      end if
    end do
  end function derived_text

  !> The tables [[sample]]. Their number and seed stand in [grid], and here for the identity of the case.
  pure function samples_text(sample) result(text)
    type(sample_t), intent(in) :: sample
    character(len=:), allocatable :: text
    integer :: i
    text = newline//'# '//to_text(sample%count)//' starts, seed '//to_text(sample%seed)//newline
    do i = 1, size(sample%names)
      text = text//newline//'[[sample]]'//newline//line('name', quoted(trim(sample%names(i))))
      if (sample%kinds(i) == 'uniform') then
        text = text//line('from', to_text(sample%first(i)))//line('to', to_text(sample%second(i)))
      else
        text = text//line('mean', to_text(sample%first(i)))//line('deviation', to_text(sample%second(i)))
      end if
    end do
  end function samples_text

  !> Whether a law is an effect that shows in records only.
  pure logical function is_sensor(law)
    type(law_choice_t), intent(in) :: law
    is_sensor = law%family == effect_family .and. index(law%name, 'sensor_') == 1
  end function is_sensor

  !> One table of a law; a barrier that is not there (at the largest number) is left out. Points have lines in the table of
  !> their structure.
  pure function law_text(law, laws) result(text)
    type(law_choice_t), intent(in) :: law, laws(:)
    character(len=:), allocatable :: text
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i, own
    text = ''
    if (law%name == 'point:row' .or. law%is_derived) return
    if (law%name /= 'point:watched') text = newline//'['//path_of(law)//']'//newline
    if (law%name == 'point:watched') then
      continue
    else if (law%family == part_family) then
      if (part_kind(law%name) /= 'body') text = text//line('law', quoted(part_law(law%name)))
      text = text//ends_text(law, reference_point_names(laws))
    else if (law%family /= effect_family .and. law%name /= 'structure') then
      text = text//line('law', quoted(trim(law%name)))
    end if
    rows = rows_of(law)
    own = size(rows)
    if (allocated(law%own)) own = own - size(law%own)
    if (allocated(law%texts)) then
      do i = 1, size(law%texts)
        text = text//line(trim(law%texts(i)%key), quoted(law%texts(i)%text))
      end do
    end if
    do i = 1, size(rows)
      if (law%family == part_family .and. is_hidden(rows(i))) cycle
      if (rows(i)%name == 'ratio' .and. has_motor(laws)) cycle
      ! A motion by an expression has no series.
      if (law%name == 'drive:motion' .and. len(text_of(law, 'position')) > 0 .and. &
          any(rows(i)%name == [character(len=9) :: 'mean', 'amplitude', 'angle'])) cycle
      associate (values => law%parameters(i)%values)
        if (rows(i)%list) then
          if (size(values) > 0 .or. law%family /= part_family) text = text//line(trim(rows(i)%name), reals(values))
        else if (i > own .and. rows(i)%unit /= '1') then
          text = text//line(trim(rows(i)%name), quoted(to_text(values(1))//' '//trim(rows(i)%unit)))
        else if (abs(values(1)) < huge(1.0_wp)) then
          text = text//line(trim(rows(i)%name), to_text(values(1)))
        end if
      end associate
    end do
    if (part_kind(law%name) == 'structure') text = text//points_text(law, laws)
    if (law%name == 'body:watched' .or. law%name == 'point:watched') then
      text = text//newline//'[watch]'//newline//line('body', quoted(trim(law%label)))
    end if
  end function law_text

  !> The ends of a part.
  pure function ends_text(law, names) result(text)
    type(law_choice_t), intent(in) :: law
    character(len=*), intent(in) :: names(:)
    character(len=:), allocatable :: text
    select case (part_kind(law%name))
    case ('body', 'structure')
      text = ''
    case ('drive')
      text = ''
      if (law%name /= 'drive:base') text = line('body', quoted(trim(names(nint(value_of(law, 'body'))))))
    case default
      text = line('between', '['//end_text('first_end')//', '//end_text('second_end')//']')
    end select

  contains

    pure function end_text(which) result(name)
      character(len=*), intent(in) :: which
      character(len=:), allocatable :: name
      integer :: number
      number = nint(value_of(law, which))
      name = quoted('ground')
      if (number > 0) name = quoted(trim(names(number)))
    end function end_text

  end function ends_text

  !> The points of a structure, a table below its own.
  pure function points_text(structure, laws) result(text)
    type(law_choice_t), intent(in) :: structure, laws(:)
    character(len=:), allocatable :: text
    integer :: i, mark
    text = ''
    do i = 1, size(laws)
      if (index(laws(i)%name, 'point:') /= 1) cycle
      mark = index(laws(i)%label, '.')
      if (laws(i)%label(:mark - 1) /= structure%label) cycle
      text = text//line(trim(laws(i)%label(mark + 1:)), reals(list_of(laws(i), 'row')))
    end do
    if (len(text) > 0) text = newline//'['//path_of(structure)//'.point]'//newline//text
  end function points_text

  !> Names of the reference points of a machine of several bodies and structures.
  pure function reference_point_names(laws) result(names)
    type(law_choice_t), intent(in) :: laws(:)
    character(len=label_length), allocatable :: names(:)
    names = pack(laws%label, index(laws%name, 'body:') == 1 .or. index(laws%name, 'point:') == 1)
  end function reference_point_names

  !> Whether the case has the table of a law: of several bodies, only those that it wrote.
  pure logical function is_written(the_case, i)
    type(case_t), intent(in) :: the_case
    integer, intent(in) :: i
    is_written = .true.
    if (the_case%laws(1)%name /= 'structure') return
    is_written = i == 1 .or. the_case%laws(i)%family == part_family .or. the_case%laws(i)%family == effect_family
  end function is_written

  pure function settings_text(the_case) result(text)
    type(case_t), intent(in) :: the_case
    character(len=:), allocatable :: text
    associate (start => the_case%start, run => the_case%run, integrator => the_case%integrator, &
               attractors => the_case%attractors)
      text = newline//'[start]'//newline// &
             line('x0', to_text(start%x0))// &
             line('v0', to_text(start%v0))// &
             line('crank_angle', to_text(start%crank_angle))// &
             newline//'[run]'//newline// &
             line('duration', to_text(run%duration))// &
             line('window', to_text(run%window))// &
             line('average', quoted(trim(run%average)))// &
             line('stop', quoted(trim(run%stop)))// &
             line('extension', to_text(run%extension))// &
             line('domain', to_text(run%domain))// &
             newline//'[integrator]'//newline// &
             line('flight', quoted(trim(integrator%flight)))// &
             line('lanes', quoted(trim(integrator%lanes)))// &
             line('tolerance', to_text(integrator%tolerance))// &
             line('event_budget', to_text(integrator%event_budget))// &
             line('step_budget', to_text(integrator%step_budget))// &
             newline//'[attractors]'//newline// &
             line('sample', to_text(attractors%sample))// &
             line('seed', to_text(attractors%seed))// &
             line('max_period', to_text(attractors%max_period))// &
             line('second_look', to_text(attractors%second_look))
    end associate
  end function settings_text

  pure function refine_text(refine) result(text)
    type(refine_t), intent(in) :: refine
    character(len=:), allocatable :: text
    text = newline//'[refine]'//newline// &
           line('step', to_text(refine%step))// &
           line('block', to_text(refine%block))// &
           line('contrast', to_text(refine%contrast))// &
           line('contrast_side', to_text(refine%contrast_side))// &
           line('probes', to_text(refine%probes))// &
           line('seed', to_text(refine%seed))
  end function refine_text

  pure function sweep_text(sweep) result(text)
    type(sweep_t), intent(in) :: sweep
    character(len=:), allocatable :: text
    text = newline//'[sweep]'//newline// &
           line('parameter', quoted(trim(sweep%swept%name)))// &
           values_text(sweep%swept%values)// &
           line('directions', quoted(trim(sweep%directions)))// &
           line('starts', integers(sweep%starts))// &
           line('x0', reals(sweep%x0))// &
           line('v0', reals(sweep%v0))// &
           line('samples', to_text(sweep%samples))// &
           line('limit_tolerance', to_text(sweep%limit_tolerance))
  end function sweep_text

  !> from, to and count where they give the same bits, otherwise the list.
  pure function values_text(values) result(text)
    real(wp), intent(in) :: values(:)
    character(len=:), allocatable :: text
    if (all(linear_values(values(1), values(size(values)), size(values)) == values)) then
      text = line('from', to_text(values(1)))//line('to', to_text(values(size(values))))// &
             line('count', to_text(size(values)))
    else
      text = line('values', reals(values))
    end if
  end function values_text

  pure function line(key, value) result(text)
    character(len=*), intent(in) :: key, value
    character(len=:), allocatable :: text
    text = key//' = '//value//newline
  end function line

  pure function reals(values) result(text)
    real(wp), intent(in) :: values(:)
    character(len=:), allocatable :: text, number
    integer :: i, length
    ! Room for all: records are long.
    allocate (character(len=longest_number*size(values) + 2) :: text)
    length = 0
    do i = 1, size(values)
      number = to_text(values(i))
      if (i > 1) number = ', '//number
      text(length + 2:length + 1 + len(number)) = number
      length = length + len(number)
    end do
    text(1:1) = '['
    text(length + 2:length + 2) = ']'
    text = text(:length + 2)
  end function reals

  pure function integers(values) result(text)
    integer, intent(in) :: values(:)
    character(len=:), allocatable :: text
    integer :: i
    text = '['
    do i = 1, size(values)
      if (i > 1) text = text//', '
      text = text//to_text(values(i))
    end do
    text = text//']'
  end function integers

  !> A TOML text: quotes, backslashes and control characters escaped.
  pure function quoted(string) result(text)
    character(len=*), intent(in) :: string
    character(len=:), allocatable :: text
    character(len=4) :: hexadecimal
    integer :: i, code
    text = '"'
    do i = 1, len(string)
      code = iachar(string(i:i))
      if (string(i:i) == '"' .or. string(i:i) == '\') then
        text = text//'\'//string(i:i)
      else if ((code >= 0 .and. code < 32) .or. code == 127) then
        write (hexadecimal, '(z4.4)') code
        text = text//'\u'//hexadecimal
      else
        text = text//string(i:i)
      end if
    end do
    text = text//'"'
  end function quoted

end module case_echo
