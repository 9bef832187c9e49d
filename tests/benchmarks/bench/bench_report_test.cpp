#include "tests/benchmarks/bench/bench_report.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/microscope/simulation/run.hpp"

namespace proofmass::test {
namespace {

BenchFigures figures() {
  return {.machine = {.processor = "A processor",
                      .num_processors = 4,
                      .compiler = "GCC 12.2.0",
                      .build_type = "Release"},
          .num_runs = 16,
          .num_orbits = 140,
          .num_steps = 4'000'000,
          .sets = {{.set = InstructionSet::scalar,
                    .run_s = 2.0,
                    .single_s = 2.0,
                    .noise = NoiseCost{.deviate_ns = 8.5, .step_ns = 250.0}},
                   {.set = InstructionSet::avx512,
                    .run_s = 0.125,
                    .single_s = 1.0,
                    .noise = NoiseCost{.deviate_ns = 0.5, .step_ns = 8.0}}},
          .scalar_step = {.noise_ns = 250.0,
                          .shared_signals_ns = 75.0,
                          .dynamics_ns = 100.0,
                          .estimation_ns = 25.0,
                          .whole_ns = 500.0},
          .start = {.digest_s = 0.125, .prepare_s = 0.0625},
          .spent = {.wall_s = 8.0, .processor_s = 6.0},
          .campaigns = {{.num_runs = 100, .wall_s = 5.0, .compute_s = 16.0}}};
}

TEST(BenchTable, ShowsSetsAndParts) {
  const std::string expected =
      "Processor  A processor, 4 processors; one is used\n"
      "Build      Release, GCC 12.2.0\n"
      "Model      " +
      std::string(model_version) +
      "\nShared     25 % of the time went to others; figures are processor time\n"
      "Start      reference digest 0.125 s, preparing the campaign 0.0625 s\n"
      "Runs       16 a set, scalar 1; of 140 orbits and 4000000 steps\n"
      R"(
set         s/run   runs/s   steps/s  ÷ scalar │ ns/deviate    bound │ bits
───────────────────────────────────────────────┼─────────────────────┼──────────
scalar       2.00    0.500   2.0e+06      1.00 │       8.50    0.500 │ reference
avx512      0.125     8.00   3.2e+07      16.0 │      0.500    0.256 │ same
bound: time of the noise alone ÷ time of the run; bits: of all results

Batches

set       1 run, s  16 runs, s    ratio
───────────────────────────────────────
avx512        1.00        2.00    0.500

A step of a scalar run; parts are measured alone and need not add up

part                  ns    share
─────────────────────────────────
noise                250     50 %
shared signals      75.0     15 %
dynamics             100     20 %
estimation          25.0      5 %
whole                500    100 %

Campaigns on all 4 processors, from the start of the program to its tables

  runs         s    runs/s   efficiency
───────────────────────────────────────
   100      5.00      20.0        0.800
efficiency: time of all runs ÷ (processors × time of the campaign)
)";
  EXPECT_EQ(bench_table(figures()), expected);
}

TEST(BenchTable, SaysWhichSetDiffers) {
  BenchFigures different = figures();
  different.sets[1].has_reference_bits = false;
  EXPECT_TRUE(all_bits_agree(figures()));
  EXPECT_FALSE(all_bits_agree(different));
  EXPECT_NE(bench_table(different).find("│ different\n"), std::string::npos);
}

TEST(BenchTable, FitsInto80Columns) {
  BenchFigures wide = figures();
  wide.num_steps = 123'456'789;
  wide.num_runs = 999'999;
  for (const double run_s : {1e-9, 123.456, 1e9}) {
    wide.sets[1] = {.set = InstructionSet::avx512,
                    .run_s = run_s,
                    .noise = NoiseCost{.deviate_ns = 1e9, .step_ns = 1e-9}};
    std::istringstream lines(bench_table(wide));
    for (std::string line; std::getline(lines, line);) {
      // Bytes that continue a UTF-8 character take no column.
      const auto width =
          std::count_if(line.begin(), line.end(), [](char c) { return (c & 0xc0) != 0x80; });
      EXPECT_LE(width, 80) << line;
    }
  }
}

// Four runs take a batch that may be a narrow one: nothing is known of a full one.
TEST(BenchTable, ComparesOnlyFullBatches) {
  BenchFigures of_few = figures();
  of_few.num_runs = 4;
  EXPECT_EQ(bench_table(of_few).find("Batches"), std::string::npos);
}

TEST(BenchTable, SaysThatTheProcessorWasFree) {
  BenchFigures free = figures();
  free.spent = {.wall_s = 8.0, .processor_s = 7.9};
  EXPECT_NE(bench_table(free).find("\nShared     no: the processor was free\n"), std::string::npos);
}

TEST(BenchJson, HoldsTheSameWithUnitsInItsNames) {
  const auto json = nlohmann::json::parse(bench_json(figures()));
  EXPECT_EQ(json["processor"], "A processor");
  EXPECT_EQ(json["num_processors"], 4);
  EXPECT_EQ(json["compiler"], "GCC 12.2.0");
  EXPECT_EQ(json["build_type"], "Release");
  EXPECT_EQ(json["model_version"], std::string(model_version));
  EXPECT_EQ(json["num_runs"], 16);
  EXPECT_EQ(json["num_orbits"], 140);
  EXPECT_EQ(json["num_steps"], 4'000'000);
  EXPECT_EQ(json["all_bits_agree"], true);
  EXPECT_EQ(json["shared_fraction"], 0.25);
  EXPECT_EQ(json["digest_s"], 0.125);
  EXPECT_EQ(json["prepare_s"], 0.0625);
  ASSERT_EQ(json["campaigns"].size(), 1U);
  EXPECT_EQ(json["campaigns"][0]["efficiency"], 0.8);
  EXPECT_EQ(json["scalar_step"], nlohmann::json({{"noise_ns", 250.0},
                                                 {"shared_signals_ns", 75.0},
                                                 {"dynamics_ns", 100.0},
                                                 {"estimation_ns", 25.0},
                                                 {"whole_ns", 500.0}}));
}

TEST(BenchJson, HoldsEachSetAndNullForWhatWasNotMeasured) {
  const auto json = nlohmann::json::parse(bench_json(figures()));
  ASSERT_EQ(json["sets"].size(), 2U);
  EXPECT_EQ(json["sets"][0], nlohmann::json({{"set", "scalar"},
                                             {"run_s", 2.0},
                                             {"single_s", 2.0},
                                             {"runs_per_s", 0.5},
                                             {"steps_per_s", 2e6},
                                             {"ratio_to_scalar", 1.0},
                                             {"deviate_ns", 8.5},
                                             {"noise_step_ns", 250.0},
                                             {"fraction_of_bound", 0.5},
                                             {"has_reference_bits", true}}));
  EXPECT_EQ(json["sets"][1], nlohmann::json({{"set", "avx512"},
                                             {"run_s", 0.125},
                                             {"single_s", 1.0},
                                             {"runs_per_s", 8.0},
                                             {"steps_per_s", 3.2e7},
                                             {"ratio_to_scalar", 16.0},
                                             {"deviate_ns", 0.5},
                                             {"noise_step_ns", 8.0},
                                             {"fraction_of_bound", 0.256},
                                             {"has_reference_bits", true}}));
}

TEST(ProcessorName, IsFoundAmongTheFactsOfTheFirstProcessor) {
  EXPECT_EQ(processor_name("processor\t: 0\nmodel\t\t: 17\nmodel name\t: AMD EPYC 9R14\n"
                           "stepping\t: 1\nmodel name\t: another\n"),
            "AMD EPYC 9R14");
  EXPECT_EQ(processor_name("processor : 0\nBogoMIPS : 243.75\n"), "unknown");
  EXPECT_EQ(processor_name(""), "unknown");
}

}  // namespace
}  // namespace proofmass::test
