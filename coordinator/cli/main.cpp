#include "coordinator/bench/bench_command.hpp"
#include "coordinator/cli/program.hpp"

int main(int argc, char** argv) {
  using namespace proofmass::coordinator;
  return run_proofmass(argc, argv, add_bench_command);
}
