! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A share of the tiles of a map or of a list of starts, computed by a job of its own into a working file of its own.
module shard
  use errors, only: error_t
  use kinds, only: int64, wp
  use map_file, only: map_file_t, working_path
  use map_schema, only: schema_t, type_float64
  use session, only: session_t
  use signals, only: end_time_limit
  use status, only: exit_done
  use text, only: to_text
  use tile_order, only: share_of
  implicit none
  private

  public :: in_shard, shard_path, describe_shard, finish_search, finish_shard

  !> The catalogues of all slices as `pack_catalogues` makes them.
  character(len=*), parameter, public :: catalogue_dataset = '/shard/catalogue'

contains

  !> Whether share `number` of `shares` has the tile. Without shares (0) all tiles are of this run.
  pure logical function in_shard(tile, number, shares)
    integer, intent(in) :: tile, number, shares
    in_shard = shares == 0
    if (shares > 0) in_shard = share_of(tile, shares) == number
  end function in_shard

  !> The name from which that of a share's working file is made.
  pure function shard_path(path, number, shares) result(name)
    character(len=*), intent(in) :: path
    integer, intent(in) :: number, shares
    character(len=:), allocatable :: name
    name = path//'.shard-'//to_text(number)//'-of-'//to_text(shares)
  end function shard_path

  !> What merge needs besides the tiles: which share it is, and for maps the catalogues of all slices as `pack_catalogues`
  !> makes them, so that they are not searched again.
  subroutine describe_shard(number, shares, schema, packed)
    integer, intent(in) :: number, shares
    type(schema_t), intent(inout) :: schema
    real(wp), intent(in), optional :: packed(:)
    call schema%add_attribute('shard', 'number', number)
    call schema%add_attribute('shard', 'shares', shares)
    if (.not. present(packed)) return
    call schema%add_dimension('packed', size(packed, kind=int64))
    call schema%add_variable('catalogue', type_float64, ['packed'], data=packed, group='shard', &
                             long_name='catalogues of all slices')
  end subroutine describe_shard

  !> Leaves the working file without a tile, for its catalogue, and ends the program.
  subroutine finish_search(session, file)
    type(session_t), intent(inout) :: session
    type(map_file_t), intent(inout) :: file
    type(error_t), allocatable :: error
    call end_time_limit()
    call file%close(session%team, error)
    call session%stop_if(error)
    call session%journal%line('shard', 'the attractors are in '//working_path(file%path)// &
      '; the shares take them with --catalogue, and this one goes on with --resume')
    call session%end_with(exit_done)
  end subroutine finish_search

  !> Leaves the working file as it is for merge, and ends the program.
  subroutine finish_shard(session, file)
    type(session_t), intent(inout) :: session
    type(map_file_t), intent(inout) :: file
    type(error_t), allocatable :: error
    call file%close(session%team, error)
    call session%stop_if(error)
    associate (command => session%command)
      call session%journal%line('shard', 'share '//to_text(command%shard)//' of '//to_text(command%shard_count)// &
        ' is done in '//working_path(file%path)//'; separatrix merge joins the shares')
    end associate
    call session%end_with(exit_done)
  end subroutine finish_shard

end module shard
