#pragma once

#include <string>

#include "tests/benchmarks/bench/bench_parts.hpp"

namespace proofmass::test {

/// Tables of at most 80 columns.
[[nodiscard]] std::string bench_table(const BenchFigures& figures);

/// The same as a JSON object; names carry their units, what was not measured is null.
[[nodiscard]] std::string bench_json(const BenchFigures& figures);

/// True if every set gave the results of the others.
[[nodiscard]] bool all_bits_agree(const BenchFigures& figures);

/// The processor's name in the text of /proc/cpuinfo; `unknown` if there is none.
[[nodiscard]] std::string processor_name(const std::string& cpuinfo);

}  // namespace proofmass::test
