! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The linear motion of a multibody structure in one mode: which joints are constraints or springs. The constrained structure
!> is taken apart into modes: pairs of complex exponentials, exponentials, and rigid motions; the response to each harmonic
!> of the drive is periodic. Where the modes are too near to being one, or the drive to one of them, `modal` is false and
!> the motion is the exponential series of `matrix`, which every linear structure has.
module mode_flow
  use bounded_lcp, only: dependent, shared_inverse
  use eigen, only: general_eigen, modulus, refine_mode, solve_complex, symmetric_eigen, undamped_modes
  use multibody, only: harmonics_in, integral_of, joint_contact, joint_soft, multibody_t, offset_of
  use multibody_state, only: is_held
  use kinds, only: int64, wp
  use matrices, only: solve
  use mode_flow_type, only: mode_flow_t
  use mode_matrix, only: set_matrix
  use mode_rows, only: set_rows
  implicit none
  private

  public :: build_flow, harmonics_of, mode_flow_t

  !> Modes nearer to each other than this share are left to the series; stiffness and damping below this share are none.
  real(wp), parameter :: worst_condition = 1e5_wp, none_at_all = 1e-12_wp, nearest_resonance = 1e-5_wp
  !> Exponents below this share of the largest have lost digits to it.
  real(wp), parameter :: stiff = 1e-3_wp

contains

  !> Number of harmonics that a machine knows.
  pure integer function harmonics_of(machine) result(harmonics)
    type(multibody_t), intent(in) :: machine
    integer :: i, j
    harmonics = size(machine%force, 2)
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        harmonics = max(harmonics, harmonics_in(joint%offset))
        if (allocated(joint%strength)) harmonics = max(harmonics, harmonics_in(joint%strength))
        if (.not. allocated(joint%load)) cycle
        do i = 1, size(joint%load%sources)
          harmonics = max(harmonics, harmonics_in(joint%load%sources(i)%offset))
        end do
      end associate
    end do
  end function harmonics_of

  !> The flow of the mode `key` (a bit per joint); `with_matrix` asks for the series beside the modes.
  pure subroutine build_flow(machine, key, with_matrix, flow)
    type(multibody_t), intent(in) :: machine
    integer(int64), intent(in) :: key
    logical, intent(in) :: with_matrix
    type(mode_flow_t), intent(out) :: flow
    complex(wp), allocatable :: forcing(:, :), surface(:, :)
    integer :: j, harmonics
    flow%key = key
    flow%stiffness = machine%stiffness
    flow%damping = machine%damping
    flow%held = [integer ::]
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        if (.not. btest(key, j - 1)) cycle
        if (is_held(joint, merge(1, 0, joint%kind == joint_contact))) then
          flow%held = [flow%held, j]
        else if (joint%kind == joint_soft) then
          call stiffen(flow, joint%row, joint%contact%stiffness, joint%contact%damping)
        else
          call stiffen(flow, joint%row, joint%stiffness, 0.0_wp)
        end if
      end associate
    end do
    harmonics = harmonics_of(machine)
    call set_constraints(machine, flow)
    call set_forcing(machine, flow, harmonics, forcing, surface)
    ! An integral makes the stiffness unsymmetric, which has no undamped modes.
    flow%modal = integral_of(machine) == 0
    if (flow%modal) call set_modes(machine, flow, forcing, surface)
    if (with_matrix .or. .not. flow%modal) call set_matrix(machine, flow, forcing, surface)
  end subroutine build_flow

  pure subroutine stiffen(flow, row, stiffness, damping)
    type(mode_flow_t), intent(inout) :: flow
    real(wp), intent(in) :: row(:), stiffness, damping
    integer :: k
    do k = 1, size(row)
      flow%stiffness(:, k) = flow%stiffness(:, k) + stiffness*row*row(k)
      flow%damping(:, k) = flow%damping(:, k) + damping*row*row(k)
    end do
  end subroutine stiffen

  !> What the constraints do to forces and accelerations. Those that depend on others share their force evenly.
  pure subroutine set_constraints(machine, flow)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(inout) :: flow
    real(wp), allocatable :: w(:, :), g(:, :), column(:), unit(:), answer(:)
    real(wp) :: left
    integer :: i, j, k, m
    logical :: ok
    m = size(flow%held)
    allocate (w(machine%n, m))
    do i = 1, m
      w(:, i) = machine%joints(flow%held(i))%row
    end do
    g = matmul(transpose(w), matmul(machine%mobility, w))
    flow%independent = [integer ::]
    do i = 1, m
      ! What the rows before leave of this one.
      column = w(:, i)
      left = g(i, i)
      k = size(flow%independent)
      if (k > 0) then
        associate (before => flow%independent)
          allocate (unit(k))
          call solve(g(before, before), g(before, i), unit, ok)
          left = g(i, i) - sum(unit*g(before, i))
          deallocate (unit)
        end associate
      end if
      if (left > dependent*g(i, i)) flow%independent = [flow%independent, i]
    end do
    k = size(flow%independent)
    allocate (flow%carried(machine%n, k), flow%hold(m, m), unit(k), answer(k))
    do i = 1, k
      unit = 0
      unit(i) = 1
      call solve(g(flow%independent, flow%independent), unit, answer, ok)
      flow%carried(:, i) = matmul(machine%mobility, matmul(w(:, flow%independent), answer))
    end do
    if (k < m) then
      flow%hold = shared_inverse(g)
    else
      do i = 1, m
        column = [(0.0_wp, k=1, m)]
        column(i) = 1
        call solve(g, column, flow%hold(:, i), ok)
      end do
    end if
    flow%reaction = matmul(flow%hold, matmul(transpose(w), machine%mobility))
    flow%still = [(keeps_still(machine, flow, j), j=1, size(machine%joints))]
  end subroutine set_constraints

  !> Whether the speed of joint `j` is constant in this mode: nothing is left of its row by the constraints.
  pure logical function keeps_still(machine, flow, j)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    integer, intent(in) :: j
    real(wp) :: alone(machine%n), left(machine%n)
    integer :: i
    keeps_still = .not. allocated(machine%joints(j)%offset%harmonic)
    alone = matmul(machine%mobility, machine%joints(j)%row)
    left = alone
    do i = 1, size(flow%independent)
      associate (joint => machine%joints(flow%held(flow%independent(i))))
        keeps_still = keeps_still .and. .not. allocated(joint%offset%harmonic)
        left = left - flow%carried(:, i)*sum(joint%row*alone)
      end associate
    end do
    keeps_still = keeps_still .and. sum(machine%joints(j)%row*left) <= dependent*sum(machine%joints(j)%row*alone)
  end function keeps_still

  !> Harmonics of the forces on the coordinates, those of springs on moving surfaces included, and of the surfaces of the
  !> constraints.
  pure subroutine set_forcing(machine, flow, harmonics, forcing, surface)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    integer, intent(in) :: harmonics
    complex(wp), allocatable, intent(out) :: forcing(:, :), surface(:, :)
    real(wp) :: w
    integer :: i, j, m
    allocate (forcing(machine%n, harmonics), surface(size(flow%held), harmonics), source=(0.0_wp, 0.0_wp))
    forcing(:, :size(machine%force, 2)) = machine%force
    do m = 1, harmonics
      w = m*machine%frequency
      do j = 1, size(machine%joints)
        associate (joint => machine%joints(j))
          if (.not. btest(flow%key, j - 1) .or. any(flow%held == j)) cycle
          if (joint%kind == joint_soft) then
            forcing(:, m) = forcing(:, m) &
              - joint%row*(joint%contact%stiffness + cmplx(0.0_wp, w, wp)*joint%contact%damping)*offset_of(joint, m)
          else
            forcing(:, m) = forcing(:, m) - joint%row*joint%stiffness*offset_of(joint, m)
          end if
        end associate
      end do
      do i = 1, size(flow%held)
        surface(i, m) = offset_of(machine%joints(flow%held(i)), m)
      end do
    end do
  end subroutine set_forcing

  !> Modes of the constrained structure, if they are well apart.
  pure subroutine set_modes(machine, flow, forcing, surface)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(inout) :: flow
    complex(wp), intent(in) :: forcing(:, :), surface(:, :)
    real(wp), allocatable :: squares(:), damping(:, :)
    call set_basis(machine, flow, squares, damping)
    flow%modal = .true.
    call set_exponentials(flow, squares, damping)
    if (flow%modal) call set_response(machine, flow, damping, squares, forcing, surface)
    if (flow%modal) call set_rows(machine, flow, forcing, surface)
  end subroutine set_modes

  !> Undamped modes of the constrained structure: flexible ones first, then rigid ones with damping, then those without.
  pure subroutine set_basis(machine, flow, squares, damping)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(inout) :: flow
    real(wp), allocatable, intent(out) :: squares(:), damping(:, :)
    real(wp), allocatable :: free(:, :), reduced(:, :), turned(:, :), levels(:), rigid_damping(:, :)
    integer, allocatable :: order(:)
    real(wp) :: largest
    integer :: m, i
    call free_shapes(machine, flow, free)
    m = size(free, 2)
    allocate (squares(m), turned(m, m))
    reduced = matmul(transpose(free), matmul(flow%stiffness, free))
    reduced = (reduced + transpose(reduced))/2
    call symmetric_eigen(reduced, squares, turned)
    free = matmul(free, turned)
    largest = 0
    if (m > 0) largest = maxval(abs(squares))
    order = [pack([(i, i=1, m)], abs(squares) > none_at_all*largest), &
             pack([(i, i=1, m)], .not. abs(squares) > none_at_all*largest)]
    flow%flexible = count(abs(squares) > none_at_all*largest)
    squares = squares(order)
    free = free(:, order)
    associate (f => flow%flexible)
      allocate (rigid_damping(m - f, m - f), levels(m - f))
      rigid_damping = matmul(transpose(free(:, f + 1:)), matmul(flow%damping, free(:, f + 1:)))
      deallocate (turned)
      allocate (turned(m - f, m - f))
      call symmetric_eigen(rigid_damping, levels, turned)
      free(:, f + 1:) = matmul(free(:, f + 1:), turned(:, m - f:1:-1))
      levels = levels(m - f:1:-1)
      flow%damped = count(levels > none_at_all*maxval(abs(flow%damping))*maxval(abs(machine%mobility)))
      flow%rigid = m - f - flow%damped
    end associate
    flow%basis = free
    flow%frequency = sqrt(abs(squares(:flow%flexible)))
    damping = matmul(transpose(free), matmul(flow%damping, free))
  end subroutine set_basis

  !> The part of the undamped shapes that moves no constraint, made orthonormal by the mass, longest first.
  pure subroutine free_shapes(machine, flow, free)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    real(wp), allocatable, intent(out) :: free(:, :)
    real(wp), allocatable :: squares(:), all_shapes(:, :)
    real(wp) :: length
    integer :: n, m, i, k, best
    n = machine%n
    m = n - size(flow%independent)
    allocate (squares(n), all_shapes(n, n), free(n, m))
    call undamped_modes(flow%stiffness, machine%mass, squares, all_shapes)
    do i = 1, n
      all_shapes(:, i) = all_shapes(:, i) - matmul(flow%carried, [(sum(machine%joints(flow%held(flow%independent(k)))%row &
                                                                       *all_shapes(:, i)), k=1, n - m)])
    end do
    do k = 1, m
      best = 1
      length = -1
      do i = 1, n
        if (sum(all_shapes(:, i)*matmul(machine%mass, all_shapes(:, i))) > length*(1 + 1e-9_wp)) then
          best = i
          length = sum(all_shapes(:, i)*matmul(machine%mass, all_shapes(:, i)))
        end if
      end do
      free(:, k) = all_shapes(:, best)/sqrt(length)
      do i = 1, 2
        free(:, k) = free(:, k) - matmul(free(:, :k - 1), matmul(transpose(free(:, :k - 1)), matmul(machine%mass, free(:, k))))
        free(:, k) = free(:, k)/sqrt(sum(free(:, k)*matmul(machine%mass, free(:, k))))
      end do
      do i = 1, n
        all_shapes(:, i) = all_shapes(:, i) - free(:, k)*sum(free(:, k)*matmul(machine%mass, all_shapes(:, i)))
      end do
    end do
  end subroutine free_shapes

  !> Exponentials of the flexible and the damped rigid coordinates.
  pure subroutine set_exponentials(flow, squares, damping)
    type(mode_flow_t), intent(inout) :: flow
    real(wp), intent(in) :: squares(:), damping(:, :)
    real(wp), allocatable :: a(:, :), level(:)
    complex(wp), allocatable :: values(:), vectors(:, :), inverse(:, :), unit(:, :)
    integer, allocatable :: kept(:)
    real(wp) :: smallest, twice
    integer :: f, d, order, i, k
    logical :: ok
    f = flow%flexible
    d = flow%damped
    order = 2*f + d
    if (flow%rigid > 0 .and. size(damping) > 0) then
      ok = maxval(abs(damping(:f + d, f + d + 1:))) <= 1e3_wp*none_at_all*max(maxval(abs(damping)), tiny(1.0_wp))
      if (f + d > 0 .and. .not. ok) then
        flow%modal = .false.
        return
      end if
    end if
    allocate (a(order, order), source=0.0_wp)
    do i = 1, f
      a(i, f + i) = flow%frequency(i)
      a(f + i, i) = -sign(flow%frequency(i), squares(i))
    end do
    a(f + 1:, f + 1:) = -damping(:f + d, :f + d)
    allocate (values(order), vectors(order, order), inverse(order, order), unit(order, order))
    call general_eigen(a, values, vectors, flow%modal)
    if (.not. flow%modal) return
    call refine_modes(flow, squares, damping(:f + d, :f + d), values, vectors, smallest, level)
    unit = 0
    do i = 1, order
      unit(i, i) = 1
    end do
    call solve_complex(vectors, unit, inverse, flow%modal)
    if (.not. flow%modal) return
    do k = 1, order
      if (sqrt(sum(modulus(vectors(:, k))**2)*sum(modulus(inverse(k, :))**2)) > worst_condition) flow%modal = .false.
      if (modulus(values(k)) < smallest) flow%modal = .false.
    end do
    if (count(aimag(values) > level) /= count(aimag(values) < -level)) flow%modal = .false.
    if (.not. flow%modal) return
    kept = pack([(k, k=1, order)], aimag(values) > -level)
    allocate (flow%shape(size(flow%basis, 1), size(kept)), flow%drift(d, size(kept)))
    flow%exponent = values(kept)
    flow%left = inverse(kept, :)
    do i = 1, size(kept)
      k = kept(i)
      if (abs(aimag(values(k))) <= level(k)) flow%exponent(i) = real(values(k))
      twice = merge(2.0_wp, 1.0_wp, aimag(values(k)) > level(k))
      flow%drift(:, i) = twice*vectors(2*f + 1:, k)/flow%exponent(i)
      flow%shape(:, i) = matmul(flow%basis(:, :f), twice*vectors(f + 1:2*f, k)/flow%exponent(i)) &
                         + matmul(flow%basis(:, f + 1:f + d), flow%drift(:, i))
    end do
    flow%size_of_exponent = modulus(flow%exponent)
    flow%size_of_left = modulus(flow%left)
  end subroutine set_exponentials

  !> Refines exponents and vectors where the smallest have lost digits beside the largest. Exponents below `smallest` are none,
  !> imaginary parts below the `level` of each.
  pure subroutine refine_modes(flow, squares, damping, values, vectors, smallest, level)
    type(mode_flow_t), intent(in) :: flow
    real(wp), intent(in) :: squares(:), damping(:, :)
    complex(wp), intent(inout) :: values(:), vectors(:, :)
    real(wp), intent(out) :: smallest
    real(wp), allocatable, intent(out) :: level(:)
    real(wp) :: stiffness(size(damping, 1)), largest
    integer :: k
    largest = maxval([0.0_wp, modulus(values)])
    smallest = 1e-9_wp*largest
    level = spread(none_at_all*largest, 1, size(values))
    if (.not. any(modulus(values) < stiff*largest)) return
    smallest = 1e-14_wp*largest
    associate (f => flow%flexible)
      stiffness = 0
      stiffness(:f) = squares(:f)
      do k = 1, size(values)
        call refine_mode(stiffness, damping, values(k), vectors(f + 1:, k))
        vectors(:f, k) = flow%frequency*vectors(f + 1:2*f, k)/values(k)
        vectors(:, k) = vectors(:, k)/sqrt(sum(modulus(vectors(:, k))**2))
      end do
    end associate
    level = none_at_all*modulus(values)
  end subroutine refine_modes

  !> Periodic response to the harmonics of the drive.
  pure subroutine set_response(machine, flow, damping, squares, forcing, surface)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(inout) :: flow
    real(wp), intent(in) :: damping(:, :), squares(:)
    complex(wp), intent(in) :: forcing(:, :), surface(:, :)
    complex(wp), allocatable :: dynamic(:, :), b(:, :), x(:, :), carried(:)
    real(wp) :: w
    integer :: m, i, order
    logical :: ok
    order = size(flow%basis, 2)
    allocate (flow%response(machine%n, size(forcing, 2)), dynamic(order, order), b(order, 1), x(order, 1))
    do m = 1, size(forcing, 2)
      w = m*machine%frequency
      if (.not. any(modulus(forcing(:, m)) > 0) .and. .not. any(modulus(surface(:, m)) > 0)) then
        flow%response(:, m) = 0
        cycle
      end if
      do i = 1, size(flow%exponent)
        if (modulus(cmplx(0.0_wp, w, wp) - flow%exponent(i)) < nearest_resonance*w) flow%modal = .false.
      end do
      if (.not. flow%modal) return
      carried = -matmul(flow%carried, surface(flow%independent, m))
      b(:, 1) = matmul(transpose(flow%basis), forcing(:, m) &
                       - matmul(flow%stiffness + cmplx(0.0_wp, w, wp)*flow%damping, carried))
      dynamic = cmplx(0.0_wp, w, wp)*damping
      do i = 1, order
        dynamic(i, i) = dynamic(i, i) - w**2
        if (i <= flow%flexible) dynamic(i, i) = dynamic(i, i) + squares(i)
      end do
      call solve_complex(dynamic, b, x, ok)
      flow%modal = ok
      if (.not. ok) return
      flow%response(:, m) = carried + matmul(flow%basis, x(:, 1))
    end do
  end subroutine set_response

end module mode_flow
