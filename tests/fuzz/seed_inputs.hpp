#pragma once

#include <map>
#include <string>

namespace proofmass::test {

/// Inputs of the fuzzer made of real messages, by the name of the file that
/// `proofmass_fuzz_corpus DIRECTORY` makes of each.
[[nodiscard]] std::map<std::string, std::string> seed_inputs();

}  // namespace proofmass::test
