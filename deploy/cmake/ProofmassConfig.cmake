# find_package(Proofmass): the libraries that programs with a model of one's own are made of, and
# proofmass_add_programs(), which makes them.
set(PROOFMASS_BUILD_COORDINATOR ON)
include(${CMAKE_CURRENT_LIST_DIR}/ProofmassDependencies.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/ProofmassTargets.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/ProofmassPrograms.cmake)
set(PROOFMASS_SOURCES ${CMAKE_CURRENT_LIST_DIR}/../../../include/proofmass)
