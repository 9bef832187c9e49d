# proofmass_add_programs(NAME name MODEL target)
#
# The three programs with a model, and that of MICROSCOPE: `target` is an object library that defines
# proofmass::built_in_model() (core/model.hpp). They have the names proofmass, proofmass-coordinator and proofmass-worker, as
# `proofmass run` finds its worker beside itself, and are built in a directory of their own, `name`
# below the current binary directory. Their targets are name_proofmass, name_proofmass-coordinator
# and name_proofmass-worker.
set(PROOFMASS_SOURCES ${CMAKE_CURRENT_LIST_DIR}/../..)
function(proofmass_add_programs)
  cmake_parse_arguments(PARSE_ARGV 0 programs "" "NAME;MODEL" "")
  set(further_models ${CMAKE_CURRENT_BINARY_DIR}/${programs_NAME}/further_models.cpp)
  file(CONFIGURE OUTPUT ${further_models} @ONLY CONTENT [[
#include <vector>

// Not by their headers, which take the compiler seconds: each model's programs compile this.
namespace proofmass {

class Model;
const Model& microscope_model();

std::vector<const Model*> further_models() { return {&microscope_model()}; }

}  // namespace proofmass
]])
  set(models ${programs_NAME}_further_models)
  add_library(${models} OBJECT ${further_models})
  target_link_libraries(${models} PRIVATE proofmass::microscope)
  set(proofmass_main coordinator/cli/main.cpp)
  set(proofmass-coordinator_main coordinator/cli/coordinator_main.cpp)
  set(proofmass-worker_main worker/main.cpp)
  foreach(program proofmass proofmass-coordinator proofmass-worker)
    set(target ${programs_NAME}_${program})
    add_executable(${target} ${PROOFMASS_SOURCES}/${${program}_main})
    set_target_properties(${target} PROPERTIES
      OUTPUT_NAME ${program} RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/${programs_NAME})
    target_link_libraries(${target} PRIVATE proofmass::cli proofmass::worker_program proofmass::microscope
      ${models} ${programs_MODEL})
  endforeach()
  add_dependencies(${programs_NAME}_proofmass ${programs_NAME}_proofmass-worker)
endfunction()
