// Writes the seeds of the fuzzer: `proofmass_fuzz_corpus DIRECTORY`.

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "tests/fuzz/seed_inputs.hpp"

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: proofmass_fuzz_corpus DIRECTORY\n");
    return 2;
  }
  for (const auto& [name, bytes] : proofmass::test::seed_inputs()) {
    std::ofstream stream(std::filesystem::path(argv[1]) / name, std::ios::binary | std::ios::trunc);
    stream << bytes;
    stream.close();
    if (!stream) {
      fmt::print(stderr, "{} cannot be written\n", name);
      return 1;
    }
  }
  return 0;
}
