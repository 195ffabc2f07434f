! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Friction of one body with memory: the rows of the same laws between parts.
module memory_rows
  use law_row, only: law_length, law_row_t, parameter_row_t
  use part_rows, only: part_laws, part_parameters
  implicit none
  private

  integer :: i

  !> What the names of these laws begin with between parts.
  character(len=*), parameter :: table = 'friction:'
  character(len=law_length), parameter, public :: memory_names(3) = [character(len=law_length) :: 'dahl', 'bouc_wen', 'lugre']

  type(law_row_t), parameter :: kept_laws(3) = pack(part_laws, part_laws%name == table//memory_names(1) .or. &
    part_laws%name == table//memory_names(2) .or. part_laws%name == table//memory_names(3))
  type(law_row_t), parameter, public :: memory_laws(3) = [(law_row_t('friction', memory_names(i), kept_laws(i)%meaning, &
    kept_laws(i)%source), i=1, 3)]

  !> One body rubs on the ground.
  character(len=len(part_parameters%meaning)), parameter :: belt = 'velocity of the surface of the ground: a belt'
  logical, parameter :: is_key(size(part_parameters)) = part_parameters%name /= 'first_end' .and. &
    part_parameters%name /= 'second_end'
  type(parameter_row_t), parameter :: dahl(4) = pack(part_parameters, is_key .and. &
    part_parameters%law == table//memory_names(1))
  type(parameter_row_t), parameter :: bouc_wen(5) = pack(part_parameters, is_key .and. &
    part_parameters%law == table//memory_names(2))
  type(parameter_row_t), parameter :: lugre(8) = pack(part_parameters, is_key .and. &
    part_parameters%law == table//memory_names(3))
  type(parameter_row_t), parameter, public :: memory_parameters(17) = [ &
    (parameter_row_t('friction', memory_names(1), dahl(i)%name, dahl(i)%unit, dahl(i)%range, &
     merge(belt, dahl(i)%meaning, dahl(i)%name == 'velocity'), &
     dahl(i)%optional, dahl(i)%default), i=1, 4), &
    (parameter_row_t('friction', memory_names(2), bouc_wen(i)%name, bouc_wen(i)%unit, bouc_wen(i)%range, &
     merge(belt, bouc_wen(i)%meaning, bouc_wen(i)%name == 'velocity'), &
     bouc_wen(i)%optional, bouc_wen(i)%default), i=1, 5), &
    (parameter_row_t('friction', memory_names(3), lugre(i)%name, lugre(i)%unit, lugre(i)%range, &
     merge(belt, lugre(i)%meaning, lugre(i)%name == 'velocity'), &
     lugre(i)%optional, lugre(i)%default), i=1, 8)]

end module memory_rows
