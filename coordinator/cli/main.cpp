#include "coordinator/cli/program.hpp"

int main(int argc, char** argv) { return proofmass::coordinator::run_proofmass(argc, argv); }
