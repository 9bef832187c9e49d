#include "coordinator/cli/command_line.hpp"

int main(int argc, char** argv) {
  return proofmass::coordinator::run_proofmass_coordinator(argc, argv);
}
