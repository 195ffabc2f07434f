# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Spack recipe (Spack 1.0 and newer): `spack repo add packaging/spack/spack_repo/separatrix`, `spack install separatrix`."""

from spack_repo.builtin.build_systems.cmake import CMakePackage

from spack.package import *


class Separatrix(CMakePackage):
    """Where the motions of impacting and rubbing machines end up: basins of attraction and bifurcation diagrams."""

    license("GPL-3.0-or-later")
    maintainers = []

    # Of a checkout: `spack develop --path . separatrix@main`. A release adds version(..., sha256=...) of its archive.
    version("main", branch="main", git="file:///path/to/separatrix")

    variant("mpi", default=True, description="Ranks that share the work, parallel HDF5")

    depends_on("c", type="build")
    depends_on("cxx", type="build")
    depends_on("fortran", type="build")
    depends_on("cmake@3.25:", type="build")
    depends_on("ninja", type="build")
    depends_on("python@3.11:", type="build")
    depends_on("git", type="build")
    depends_on("gsl")
    depends_on("toml11@3.7:3")
    depends_on("zlib-api")
    depends_on("isa-l")
    depends_on("mpi", when="+mpi")
    depends_on("hdf5@1.10:1.14+fortran+hl+mpi", when="+mpi")
    depends_on("hdf5@1.10:1.14+fortran+hl~mpi", when="~mpi")

    # Labels depend on the last bit: the strict flags are those of GCC.
    requires("%gcc@12:", msg="Separatrix is tested with GCC 12 and newer")

    generator("ninja")

    def cmake_args(self):
        """Arguments of CMake."""
        return [self.define_from_variant("SEPARATRIX_MPI", "mpi"), self.define("SEPARATRIX_TESTS", False)]
