! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Who computed a file, where, when and with what.
module provenance
  use h5, only: h5_version
  use kinds, only: real64
  use map_schema, only: format_version, schema_t
  use system, only: cpu_name, environment_text, host_name, monotonic_seconds, utc_now
  use team, only: host_length, team_t
  use text, only: join
  implicit none
  private

  public :: start_provenance, command_line

  type, public :: provenance_t
    !> Set by the program.
    character(len=:), allocatable :: version, commit, compiler, flags, c_flags, mpi
    !> What computes: processor or GPU.
    character(len=:), allocatable :: device
    !> Set by `start_provenance`.
    character(len=:), allocatable :: command, hosts, started
    integer :: ranks = 1, host_count = 1
    real(real64) :: start_seconds = 0
  contains
    procedure :: describe
    procedure :: finish
  end type provenance_t

contains

  !> Notes ranks, hosts, command line and time. Collective.
  subroutine start_provenance(team, record)
    class(team_t), intent(in) :: team
    type(provenance_t), intent(inout) :: record
    character(len=host_length), allocatable :: names(:)
    call team%hosts(host_name(), names)
    record%hosts = join(names, ' ')
    record%host_count = size(names)
    record%ranks = team%size()
    record%command = command_line()
    record%started = utc_now()
    record%start_seconds = monotonic_seconds()
  end subroutine start_provenance

  !> The command line of this program, words separated by blanks.
  function command_line() result(text)
    character(len=:), allocatable :: text
    integer :: length
    call get_command(length=length)
    allocate (character(len=length) :: text)
    call get_command(text)
  end function command_line

  !> Adds what is known at the start: attributes of the root and of the group `provenance`.
  subroutine describe(self, schema)
    class(provenance_t), intent(in) :: self
    type(schema_t), intent(inout) :: schema
    call schema%add_attribute('', 'Conventions', 'CF-1.10')
    call schema%add_attribute('', 'source', 'Separatrix '//self%version)
    call schema%add_attribute('', 'history', self%started//' '//self%command)
    call schema%add_attribute('', 'format', 'separatrix')
    call schema%add_attribute('', 'format_version', format_version)
    call schema%add_attribute('', 'date_created', self%started)
    call schema%add_attribute('', 'complete', 0)
    call schema%add_attribute('provenance', 'version', self%version)
    call schema%add_attribute('provenance', 'commit', self%commit)
    call schema%add_attribute('provenance', 'compiler', self%compiler)
    call schema%add_attribute('provenance', 'flags', self%flags)
    call schema%add_attribute('provenance', 'c_flags', self%c_flags)
    call schema%add_attribute('provenance', 'mpi', self%mpi)
    call schema%add_attribute('provenance', 'hdf5', h5_version())
    call schema%add_attribute('provenance', 'command_line', self%command)
    call schema%add_attribute('provenance', 'ranks', self%ranks)
    call schema%add_attribute('provenance', 'hosts', self%hosts)
    call schema%add_attribute('provenance', 'host_count', self%host_count)
    call schema%add_attribute('provenance', 'processor', cpu_name())
    if (allocated(self%device)) call schema%add_attribute('provenance', 'device', self%device)
    call schema%add_attribute('provenance', 'environment', environment_text())
    call schema%add_attribute('provenance', 'started', self%started)
  end subroutine describe

  !> Adds what is known at the end.
  subroutine finish(self, extra)
    class(provenance_t), intent(in) :: self
    type(schema_t), intent(inout) :: extra
    call extra%add_attribute('provenance', 'finished', utc_now())
    call extra%add_attribute('provenance', 'wall_seconds', monotonic_seconds() - self%start_seconds)
  end subroutine finish

end module provenance
