#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# gfortran 12.2.0 (Debian 12): `associate (nodes => array%component)` of an array of derived type, with `nodes` as a subscript.
#
# Guess before trying: the name stands for a section with a stride; `value(nodes)` is `value(array%component)`.
# Seen: the name prints and copies as it should, but as a subscript it is read as if its elements lay side by side, so that members
# of neighbouring components become subscripts: values of other elements, at -O0 as at -O2, and without a word from -Wall and
# -fcheck=all.
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
cat > subscript.f90 << 'FORTRAN'
program main
  implicit none
  type :: switch_t
    integer :: argument = 0, other = 0
  end type switch_t
  type(switch_t) :: switches(3) = [switch_t(4, 9), switch_t(2, 8), switch_t(5, 7)]
  real :: value(9) = [10., 20., 30., 40., 50., 60., 70., 80., 90.]
  integer :: copied(3)
  print '(a, 3f5.0)', 'component itself:', value(switches%argument)
  associate (nodes => switches%argument)
    print '(a, 3i5)', 'associated name: ', nodes
    print '(a, 3f5.0)', 'as a subscript:  ', value(nodes)
    copied = nodes
  end associate
  print '(a, 3f5.0)', 'copied:          ', value(copied)
end program main
FORTRAN
gcc=/usr/lib/gcc/x86_64-linux-gnu/12
libraries=$folder/tree$gcc
for options in "-O0" "-O2" "-O0 -Wall -Wextra -fcheck=all"; do
  # shellcheck disable=SC2086
  "tree/usr/bin/x86_64-linux-gnu-gfortran-12" -B "$libraries" -B "$gcc" -L "$libraries" $options -c subscript.f90
  gcc-12 subscript.o -o subscript -L "$libraries" -L tree/usr/lib/x86_64-linux-gnu -lgfortran -lm
  echo "$options"
  LD_LIBRARY_PATH=tree/usr/lib/x86_64-linux-gnu ./subscript
done 2>&1 | tee seen.txt
diff seen.txt - << 'EXPECTED'
-O0
component itself:  40.  20.  50.
associated name:     4    2    5
as a subscript:    40.  90.  20.
copied:            40.  20.  50.
-O2
component itself:  40.  20.  50.
associated name:     4    2    5
as a subscript:    40.  90.  20.
copied:            40.  20.  50.
-O0 -Wall -Wextra -fcheck=all
component itself:  40.  20.  50.
associated name:     4    2    5
as a subscript:    40.  90.  20.
copied:            40.  20.  50.
EXPECTED
