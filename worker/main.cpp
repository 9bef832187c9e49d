#include "worker/program.hpp"

int main(int argc, char** argv) {
  return proofmass::worker::run_worker(argc, argv, {.name = "proofmass-worker"});
}
