#pragma once

#include <map>
#include <string>

namespace proofmass::test {

/// Inputs of the fuzzer made of real messages, by the name of their file in corpus/. Made anew
/// when the protocol changes: `proofmass_fuzz_corpus DIRECTORY` writes them.
[[nodiscard]] std::map<std::string, std::string> seed_inputs();

}  // namespace proofmass::test
