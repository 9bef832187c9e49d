// libFuzzer's entry.

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "tests/fuzz/fuzz_input.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  (void)proofmass::test::run_fuzz_input({reinterpret_cast<const char*>(data), size});
  return 0;
}
