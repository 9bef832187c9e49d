# What the libraries of Proofmass need, for its own tree and for projects that are built with it.
# With PROOFMASS_BUILD_COORDINATOR off, what the worker alone needs.
find_package(Threads REQUIRED)
find_package(Eigen3 3.4 CONFIG REQUIRED)
find_package(Boost 1.74 REQUIRED)  # Headers only.
find_package(fmt 9 CONFIG REQUIRED)
find_package(Protobuf 3.21 REQUIRED)  # Debian 12 has it in module mode only.
find_package(spdlog 1.10 CONFIG REQUIRED)
find_package(cppzmq CONFIG REQUIRED)
find_package(CLI11 2.1 CONFIG REQUIRED)
find_package(tomlplusplus 3.3 CONFIG REQUIRED)
find_package(nlohmann_json 3.11 CONFIG REQUIRED)
find_package(utf8cpp 3.2 CONFIG REQUIRED)
find_package(PkgConfig REQUIRED)  # cppzmq finds libzmq by it.
if(PROOFMASS_BUILD_COORDINATOR)
  find_package(SQLite3 3.40 REQUIRED)
  pkg_check_modules(SODIUM REQUIRED IMPORTED_TARGET libsodium>=1.0.18)
  # CMake's own module needs a C compiler to find it.
  pkg_search_module(HDF5 REQUIRED IMPORTED_TARGET hdf5-serial>=1.10 hdf5>=1.10)
  # Debian's shared HDF5 loads curl and with it 26 libraries, which took half of each start of a program
  # to write a format that few commands need. Its archive needs none of them.
  find_library(PROOFMASS_HDF5_ARCHIVE libhdf5.a HINTS ${HDF5_LIBRARY_DIRS})
  find_library(PROOFMASS_SZIP sz)
  find_package(ZLIB)
  add_library(proofmass::hdf5 INTERFACE IMPORTED)
  if(PROOFMASS_HDF5_ARCHIVE AND PROOFMASS_SZIP AND ZLIB_FOUND)
    target_include_directories(proofmass::hdf5 SYSTEM INTERFACE ${HDF5_INCLUDE_DIRS})
    target_link_libraries(proofmass::hdf5 INTERFACE
      ${PROOFMASS_HDF5_ARCHIVE} ${PROOFMASS_SZIP} ZLIB::ZLIB ${CMAKE_DL_LIBS} m)
  else()
    target_link_libraries(proofmass::hdf5 INTERFACE PkgConfig::HDF5)
  endif()
endif()
