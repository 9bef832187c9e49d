// Uses many mutated campaign databases, by hand: proofmass_fuzz_files FIRST LAST DIRECTORY. The
// number of each file is written to DIRECTORY/number before it is used, so that whoever starts this
// program knows which one it died of; file_fuzz.py does.

#include <sys/time.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/fuzz/file_mutator.hpp"
#include "tests/fuzz/file_world.hpp"

int main(int argc, char** argv) {
  using namespace proofmass::test;
  constexpr itimerval processor_time_max{.it_interval = {.tv_sec = 0, .tv_usec = 0},
                                         .it_value = {.tv_sec = 4, .tv_usec = 0}};
  if (argc != 4) {
    (void)std::fprintf(stderr, "usage: proofmass_fuzz_files FIRST LAST DIRECTORY\n");
    return 2;
  }
  const std::filesystem::path directory(argv[3]);
  const std::filesystem::path seeds = directory / "seeds";
  std::filesystem::remove_all(seeds);
  std::filesystem::create_directories(seeds);
  const auto originals = make_seed_files(seeds);
  std::filesystem::create_directories(directory / "used");
  int num_failed = 0;
  for (std::uint64_t seed = std::stoull(argv[1]); seed <= std::stoull(argv[2]); ++seed) {
    FileMutator mutator(seed);
    const std::filesystem::path file = directory / "used" / "x.db";
    mutator.make(originals, file);
    const auto use = static_cast<FileUse>(seed % num_file_uses);
    std::ofstream(directory / "number") << seed << "\n";
    setitimer(ITIMER_PROF, &processor_time_max, nullptr);  // What hangs is ended by SIGPROF.
    const std::string text = use_file(use, file, originals[0]);
    if (!text.empty()) {
      (void)std::printf("seed %llu use %d: %s\n", static_cast<unsigned long long>(seed),
                        static_cast<int>(use), text.c_str());
      (void)std::fflush(stdout);
      ++num_failed;
    }
  }
  return num_failed == 0 ? 0 : 1;
}
