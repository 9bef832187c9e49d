# Builds for ARM64 on another machine: Debian's cross-compiler, the libraries of make-sysroot.sh in
# PROOFMASS_SYSROOT, and qemu-aarch64 for programs that the build runs. protoc is this machine's.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)

# Of the checks of the compiler, too.
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES PROOFMASS_SYSROOT)
set(CMAKE_SYSROOT ${PROOFMASS_SYSROOT})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_LIBDIR}
  ${PROOFMASS_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${PROOFMASS_SYSROOT}/usr/share/pkgconfig)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${PROOFMASS_SYSROOT})

set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64;-L;${PROOFMASS_SYSROOT})
