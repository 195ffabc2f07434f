! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Reads an expression such as `k3*x^3 - a*tanh(v/v0) + f*cos(2*pi*nu*t)` onto a tape.
!>
!> Powers bind strongest and from the right, then signs (-x^2 is -(x^2)), products, sums. `if(a < b, c, d)` has branches.
module expression_text
  use errors, only: error_t, fail
  use expression_names, only: letters, name_letters
  use kinds, only: wp
  use operations, only: op_add, op_divide, op_multiply, op_negative, op_subtract
  use status, only: exit_bad_case
  use suggest, only: nearest_word
  use tape, only: constant, most_nodes, tape_t
  use tape_algebra, only: binary, choice, unary
  use tape_functions, only: apply_function, argument_counts, function_names, function_number, power
  use text, only: join, number_in, number_length, to_text
  implicit none
  private

  public :: read_expression

  !> Most parentheses, functions and exponents within each other, and characters of a text.
  integer, parameter, public :: deepest = 100, longest_text = 100000
  integer, parameter :: longest_name = 64, most_arguments = 16
  character(len=*), parameter :: blanks = ' '//achar(9)//achar(10)//achar(13)
  real(wp), parameter :: pi = 3.14159265358979323846264338327950288_wp

  type :: reader_t
    character(len=:), allocatable :: text
    integer :: at = 1, depth = 0
    character(len=longest_name), allocatable :: names(:)
    integer, allocatable :: nodes(:)
  end type reader_t

contains

  !> Node of the expression in `text`; `names` are the names that it may use and `nodes` their nodes on the tape. An error
  !> names the column, what was found there and what is allowed.
  pure subroutine read_expression(text, names, nodes, tape, node, error)
    character(len=*), intent(in) :: text, names(:)
    integer, intent(in) :: nodes(:)
    type(tape_t), intent(inout) :: tape
    integer, intent(out) :: node
    type(error_t), allocatable, intent(out) :: error
    type(reader_t) :: reader
    node = 0
    if (len(text) > longest_text) then
      call fail(error, exit_bad_case, 'found an expression of '//to_text(len(text))//' characters, allowed are '// &
                to_text(longest_text))
      return
    end if
    ! A blank ends it, so that the character at a position is always there.
    reader%text = text//' '
    allocate (reader%names(size(names)))
    reader%names = names
    reader%nodes = nodes
    call skip_blanks(reader)
    call read_sum(reader, tape, node, error)
    if (allocated(error)) return
    if (reader%at <= len(text)) call report(reader, 'an operator or the end', error)
  end subroutine read_expression

  pure recursive subroutine read_sum(reader, tape, node, error)
    type(reader_t), intent(inout) :: reader
    type(tape_t), intent(inout) :: tape
    integer, intent(out) :: node
    type(error_t), allocatable, intent(out) :: error
    integer :: left, right, operation
    call read_product(reader, tape, node, error)
    do while (.not. allocated(error))
      operation = scan('+-', next(reader))
      if (operation == 0) return
      call advance(reader, 1)
      left = node
      call read_product(reader, tape, right, error)
      if (allocated(error)) return
      call binary(tape, merge(op_add, op_subtract, operation == 1), left, right, node)
      call check_size(reader, tape, error)
    end do
  end subroutine read_sum

  pure recursive subroutine read_product(reader, tape, node, error)
    type(reader_t), intent(inout) :: reader
    type(tape_t), intent(inout) :: tape
    integer, intent(out) :: node
    type(error_t), allocatable, intent(out) :: error
    integer :: left, right, operation
    call read_signed(reader, tape, node, error)
    do while (.not. allocated(error))
      operation = scan('*/', next(reader))
      if (operation == 0) return
      call advance(reader, 1)
      if (operation == 1 .and. next(reader) == '*') then
        call report(reader, 'a factor; a power is written with ^', error)
        return
      end if
      left = node
      call read_signed(reader, tape, right, error)
      if (allocated(error)) return
      call binary(tape, merge(op_multiply, op_divide, operation == 1), left, right, node)
      call check_size(reader, tape, error)
    end do
  end subroutine read_product

  !> A power with signs before it.
  pure recursive subroutine read_signed(reader, tape, node, error)
    type(reader_t), intent(inout) :: reader
    type(tape_t), intent(inout) :: tape
    integer, intent(out) :: node
    type(error_t), allocatable, intent(out) :: error
    logical :: is_negative
    integer :: positive
    is_negative = .false.
    node = 0
    do while (scan('+-', next(reader)) > 0)
      is_negative = is_negative .neqv. next(reader) == '-'
      call advance(reader, 1)
    end do
    call read_power(reader, tape, positive, error)
    if (allocated(error)) return
    node = positive
    if (is_negative) call unary(tape, op_negative, positive, node)
  end subroutine read_signed

  pure recursive subroutine read_power(reader, tape, node, error)
    type(reader_t), intent(inout) :: reader
    type(tape_t), intent(inout) :: tape
    integer, intent(out) :: node
    type(error_t), allocatable, intent(out) :: error
    integer :: base, exponent
    call read_operand(reader, tape, node, error)
    if (allocated(error) .or. next(reader) /= '^') return
    call descend(reader, error)
    if (allocated(error)) return
    call advance(reader, 1)
    base = node
    call read_signed(reader, tape, exponent, error)
    if (allocated(error)) return
    reader%depth = reader%depth - 1
    call power(tape, base, exponent, node)
    call check_size(reader, tape, error)
  end subroutine read_power

  !> A number, a name, a function or a sum in parentheses.
  pure recursive subroutine read_operand(reader, tape, node, error)
    type(reader_t), intent(inout) :: reader
    type(tape_t), intent(inout) :: tape
    integer, intent(out) :: node
    type(error_t), allocatable, intent(out) :: error
    node = 0
    if (scan(letters, next(reader)) > 0) then
      call read_name(reader, tape, node, error)
    else if (next(reader) == '(') then
      call descend(reader, error)
      if (allocated(error)) return
      call advance(reader, 1)
      call read_sum(reader, tape, node, error)
      if (.not. allocated(error)) call expect(reader, ')', 'an operator or )', error)
      reader%depth = reader%depth - 1
    else
      call read_number(reader, tape, node, error)
    end if
  end subroutine read_operand

  pure subroutine read_number(reader, tape, node, error)
    type(reader_t), intent(inout) :: reader
    type(tape_t), intent(inout) :: tape
    integer, intent(out) :: node
    type(error_t), allocatable, intent(out) :: error
    character(len=longest_name) :: digits
    integer :: length, status
    real(wp) :: value
    node = 0
    ! A sign is no part of it, and no number is longer.
    length = 0
    if (scan('0123456789.', next(reader)) > 0) then
      length = number_length(reader%text(reader%at:min(len(reader%text), reader%at + longest_name)))
    end if
    if (length == 0) then
      call report(reader, 'a number, a name or (', error)
      return
    else if (length > longest_name) then
      call report(reader, 'a number of at most '//to_text(longest_name)//' characters', error)
      return
    end if
    digits = reader%text(reader%at:reader%at + length - 1)
    read (digits, *, iostat=status) value
    if (status == 0) status = merge(0, 1, abs(value) <= huge(value))
    if (status /= 0) then
      call report(reader, 'a finite number', error)
      return
    end if
    call constant(tape, value, node)
    call advance(reader, length)
    if (scan(letters, next(reader)) > 0) call report(reader, 'an operator after the number, as in 2*x', error)
  end subroutine read_number

  pure recursive subroutine read_name(reader, tape, node, error)
    type(reader_t), intent(inout) :: reader
    type(tape_t), intent(inout) :: tape
    integer, intent(out) :: node
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: name
    integer :: from, known, number
    node = 0
    from = reader%at
    name = word_at(reader)
    if (len(name) > longest_name) then
      call fail(error, exit_bad_case, 'column '//to_text(from)//': found a name of '//to_text(len(name))// &
                ' characters, allowed: '//to_text(longest_name))
      return
    end if
    call advance(reader, len(name))
    if (next(reader) == '(') then
      number = function_number(name)
      if (number > 0) then
        call read_call(reader, tape, number, node, error)
        return
      end if
      known = -1
    else
      known = number_in(reader%names, name)
    end if
    if (known > 0) then
      node = reader%nodes(known)
    else if (known == 0 .and. name == 'pi') then
      call constant(tape, pi, node)
    else
      reader%at = from
      call report_name(reader, name, known < 0, error)
    end if
  end subroutine read_name

  !> The arguments of a function and its node.
  pure recursive subroutine read_call(reader, tape, number, node, error)
    type(reader_t), intent(inout) :: reader
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: number
    integer, intent(out) :: node
    type(error_t), allocatable, intent(out) :: error
    integer :: arguments(most_arguments), count, at_zero, condition, wanted
    logical :: is_open
    node = 0
    count = 0
    condition = 0
    wanted = argument_counts(number)
    is_open = any(function_names(number) == ['min', 'max'])
    call descend(reader, error)
    if (allocated(error)) return
    do
      call advance(reader, 1)
      count = count + 1
      if (function_names(number) == 'if' .and. count == 1) then
        call read_condition(reader, tape, condition, at_zero, error)
      else
        call read_sum(reader, tape, arguments(count), error)
      end if
      if (allocated(error)) return
      if (next(reader) /= ',' .or. count == merge(most_arguments, wanted, is_open)) exit
    end do
    if (count < wanted) then
      call report(reader, 'a comma: '//trim(function_names(number))//' has '//to_text(wanted)//' arguments', error)
      return
    end if
    call expect(reader, ')', 'an operator or )', error)
    if (allocated(error)) return
    reader%depth = reader%depth - 1
    if (condition > 0) then
      call choice(tape, condition, at_zero, arguments(2), arguments(3), node)
    else
      call apply_function(tape, number, arguments(:count), node)
    end if
    call check_size(reader, tape, error)
  end subroutine read_call

  !> a < b, <=, >, >=: the function that is positive where it holds, and whether it holds where that is zero.
  pure recursive subroutine read_condition(reader, tape, node, at_zero, error)
    type(reader_t), intent(inout) :: reader
    type(tape_t), intent(inout) :: tape
    integer, intent(out) :: node, at_zero
    type(error_t), allocatable, intent(out) :: error
    integer :: left, right, sense
    node = 0
    at_zero = -1
    call read_sum(reader, tape, left, error)
    if (allocated(error)) return
    sense = scan('<>', next(reader))
    if (sense == 0) then
      call report(reader, 'an operator or <, <=, >, >=', error)
      return
    end if
    reader%at = reader%at + 1
    if (next(reader) == '=') then
      at_zero = 1
      reader%at = reader%at + 1
    end if
    call skip_blanks(reader)
    call read_sum(reader, tape, right, error)
    if (allocated(error)) return
    if (sense == 1) then
      call binary(tape, op_subtract, right, left, node)
    else
      call binary(tape, op_subtract, left, right, node)
    end if
  end subroutine read_condition

  pure character function next(reader)
    type(reader_t), intent(in) :: reader
    next = reader%text(reader%at:reader%at)
  end function next

  !> To the next character after `count` that is not blank; the last blank of the text is the end.
  pure subroutine advance(reader, count)
    type(reader_t), intent(inout) :: reader
    integer, intent(in) :: count
    reader%at = reader%at + count
    call skip_blanks(reader)
  end subroutine advance

  pure subroutine skip_blanks(reader)
    type(reader_t), intent(inout) :: reader
    integer :: length
    length = verify(reader%text(reader%at:), blanks)
    if (length > 0) reader%at = reader%at + length - 1
    if (length == 0) reader%at = len(reader%text)
  end subroutine skip_blanks

  !> The name that begins here.
  pure function word_at(reader) result(word)
    type(reader_t), intent(in) :: reader
    character(len=:), allocatable :: word
    integer :: length
    length = verify(reader%text(reader%at:), name_letters) - 1
    word = reader%text(reader%at:reader%at + length - 1)
  end function word_at

  pure subroutine descend(reader, error)
    type(reader_t), intent(inout) :: reader
    type(error_t), allocatable, intent(out) :: error
    reader%depth = reader%depth + 1
    if (reader%depth > deepest) call report(reader, 'at most '//to_text(deepest)//' levels of parentheses and powers', error)
  end subroutine descend

  pure subroutine expect(reader, wanted, allowed, error)
    type(reader_t), intent(inout) :: reader
    character(len=*), intent(in) :: wanted, allowed
    type(error_t), allocatable, intent(out) :: error
    if (next(reader) == wanted) then
      call advance(reader, 1)
    else
      call report(reader, allowed, error)
    end if
  end subroutine expect

  pure subroutine check_size(reader, tape, error)
    type(reader_t), intent(in) :: reader
    type(tape_t), intent(in) :: tape
    type(error_t), allocatable, intent(out) :: error
    if (tape%is_full) call report(reader, 'at most '//to_text(most_nodes)//' operations', error)
  end subroutine check_size

  !> Error: the column, what is there, and what is allowed.
  pure subroutine report(reader, allowed, error)
    type(reader_t), intent(in) :: reader
    character(len=*), intent(in) :: allowed
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: found
    found = "'"//next(reader)//"'"
    if (scan(letters, next(reader)) > 0) found = "'"//word_at(reader)//"'"
    if (reader%at >= len(reader%text)) found = 'the end'
    call fail(error, exit_bad_case, 'column '//to_text(reader%at)//': found '//found//', allowed: '//allowed)
  end subroutine report

  !> Error: a name or function that is not known, with the nearest one that is.
  pure subroutine report_name(reader, name, is_function, error)
    type(reader_t), intent(in) :: reader
    character(len=*), intent(in) :: name
    logical, intent(in) :: is_function
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: meant, allowed
    if (is_function) then
      meant = nearest_word(name, function_names)
      allowed = join(function_names, ', ')
    else
      meant = nearest_word(name, reader%names)
      allowed = join(reader%names, ', ')
      if (len(allowed) > 0) allowed = allowed//', '
      allowed = allowed//'pi'
    end if
    ! Few letters are as near to any others.
    if (len(name) <= 2) meant = ''
    if (len(name) == 3 .and. verify(name, meant) > 0) meant = ''
    if (len(meant) > 0) meant = ' (did you mean "'//meant//'"?)'
    if (is_function .and. (name == 'pow' .or. name == 'power')) meant = ' (a power is written with ^)'
    call fail(error, exit_bad_case, 'column '//to_text(reader%at)//': found '//trim(merge('function', 'name    ', is_function))// &
              " '"//name//"'"//meant//', allowed: '//allowed)
  end subroutine report_name

end module expression_text
