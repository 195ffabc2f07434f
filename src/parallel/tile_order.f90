! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Where the tiles of a map lie in its working file: in the order in which they are handed out, share by share, so that what one
!> node computes lies in one piece.
module tile_order
  use kinds, only: int64
  use spread_order, only: new_spread_order, spread_order_t
  implicit none
  private

  public :: new_tile_order, share_of

  type, public :: tile_order_t
    integer, private :: tiles = 0, shares = 1
    !> The order within a share that has one tile more than others, and within one of the others.
    type(spread_order_t), private :: longer, shorter
  contains
    procedure :: slot_of
    procedure :: tile_at
  end type tile_order_t

contains

  !> The order of the tiles 1..`tiles` of so many shares.
  pure function new_tile_order(tiles, shares) result(order)
    integer, intent(in) :: tiles, shares
    type(tile_order_t) :: order
    order%tiles = tiles
    order%shares = shares
    order%shorter = new_spread_order(tiles/shares)
    if (modulo(tiles, shares) > 0) order%longer = new_spread_order(tiles/shares + 1)
  end function new_tile_order

  !> The share (from 1) that has a tile: every one has each `shares`-th, so that it has its part of the hard regions.
  pure integer function share_of(tile, shares)
    integer, intent(in) :: tile, shares
    share_of = 1 + modulo(tile - 1, shares)
  end function share_of

  !> The slot (from 1) of a tile.
  pure integer function slot_of(self, tile)
    class(tile_order_t), intent(in) :: self
    integer, intent(in) :: tile
    integer :: share, within
    share = share_of(tile, self%shares)
    within = (tile - 1)/self%shares + 1
    if (is_longer(self, share)) then
      slot_of = before(self, share) + self%longer%number_of(within)
    else
      slot_of = before(self, share) + self%shorter%number_of(within)
    end if
  end function slot_of

  !> The tile in a slot (from 1).
  pure integer function tile_at(self, slot)
    class(tile_order_t), intent(in) :: self
    integer, intent(in) :: slot
    integer :: share, within, long_ones, length
    length = self%tiles/self%shares
    long_ones = modulo(self%tiles, self%shares)
    if (slot <= long_ones*(length + 1)) then
      share = (slot - 1)/(length + 1) + 1
    else
      share = long_ones + (slot - long_ones*(length + 1) - 1)/length + 1
    end if
    within = slot - before(self, share)
    if (is_longer(self, share)) then
      within = self%longer%item(within)
    else
      within = self%shorter%item(within)
    end if
    tile_at = int((within - 1)*int(self%shares, int64)) + share
  end function tile_at

  !> Whether a share has one tile more than the last one.
  pure logical function is_longer(self, share)
    class(tile_order_t), intent(in) :: self
    integer, intent(in) :: share
    is_longer = share <= modulo(self%tiles, self%shares)
  end function is_longer

  !> The tiles of all shares before one.
  pure integer function before(self, share)
    class(tile_order_t), intent(in) :: self
    integer, intent(in) :: share
    before = (share - 1)*(self%tiles/self%shares) + min(share - 1, modulo(self%tiles, self%shares))
  end function before

end module tile_order
