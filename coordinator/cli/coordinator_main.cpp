#include "coordinator/cli/program.hpp"

int main(int argc, char** argv) {
  return proofmass::coordinator::run_proofmass_coordinator(argc, argv);
}
