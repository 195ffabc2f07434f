#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# gfortran 12.2.0 (Debian 12): a function with the result `character(len=:), allocatable` that is called within an expression.
#
# Guess before trying: with `recursive`, -frecursive or -fopenmp every call has its own variables.
# Seen: the length of each such result lies in static memory of the procedure that calls (`slen` in the symbols). A recursive
# function that joins such a result with one of its own calls loses characters, without a warning: 'ddddcccbba.' becomes 'dcba.'.
# Threads that make texts at the same time write beyond them. A result that is assigned to a variable first is whole.
#
# Needs Debian 12 with gcc-12; the compiler proper is fetched into a temporary folder.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
for package in gfortran-12 libgfortran-12-dev libgfortran5; do
  apt-get download -o APT::Sandbox::User=root -qq "$package=12.2.0-14+deb12u1"
  dpkg -x "$package"_*.deb tree
done
cat > joined.f90 << 'FORTRAN'
module texts
contains
  pure function letters(n) result(t)
    integer, intent(in) :: n
    character(len=:), allocatable :: t
    t = repeat(achar(96 + n), n)
  end function letters
  recursive function joined(n) result(t)
    integer, intent(in) :: n
    character(len=:), allocatable :: t
    t = '.'
    if (n > 0) t = letters(n)//joined(n - 1)
  end function joined
  recursive function in_steps(n) result(t)
    integer, intent(in) :: n
    character(len=:), allocatable :: t, rest
    t = '.'
    if (n == 0) return
    rest = in_steps(n - 1)
    t = letters(n)//rest
  end function in_steps
end module texts
program main
  use texts
  print '(2a)', 'in an expression: ', joined(4)
  print '(2a)', 'by a variable:    ', in_steps(4)
end program main
FORTRAN
gcc=/usr/lib/gcc/x86_64-linux-gnu/12
libraries=$folder/tree$gcc
for options in "-O0 -frecursive" "-O2 -frecursive" "-O2 -fopenmp"; do
  # shellcheck disable=SC2086
  "tree/usr/bin/x86_64-linux-gnu-gfortran-12" -B "$libraries" -B "$gcc" -L "$libraries" $options -c joined.f90
  gcc-12 joined.o -o joined -L "$libraries" -L tree/usr/lib/x86_64-linux-gnu -lgfortran -lm
  echo "$options, lengths in static memory: $(nm joined.o | grep -q ' b slen' && echo yes || echo no)"
  LD_LIBRARY_PATH=tree/usr/lib/x86_64-linux-gnu ./joined
done | tee seen.txt
diff seen.txt - << 'EXPECTED'
-O0 -frecursive, lengths in static memory: yes
in an expression: dcba.
by a variable:    ddddcccbba.
-O2 -frecursive, lengths in static memory: yes
in an expression: dcba.
by a variable:    ddddcccbba.
-O2 -fopenmp, lengths in static memory: yes
in an expression: dcba.
by a variable:    ddddcccbba.
EXPECTED
