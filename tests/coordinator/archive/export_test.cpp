#include "coordinator/archive/export.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>

#include "coordinator/report/digest.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/coordinator/archive/csv_cells.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::Each;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class Export : public test::StoreTest {
 protected:
  Export()
      : store_(test::store_of(file(), test::campaign_of(5), test::results_of_each_status(5))) {}

  [[nodiscard]] std::filesystem::path output() const { return directory() / "output"; }

  std::string csv() {
    TextOutput text(output());
    export_csv(store_, text, test::never_stopped);
    return test::content_of(output());
  }
  std::string json() {
    TextOutput text(output());
    export_json(store_, text, test::never_stopped);
    return test::content_of(output());
  }

  Store store_;
};

TEST_F(Export, OfCsvHasALineARunThatReadsBackToTheSameBits) {
  const std::string text = csv();
  std::istringstream stream(text);
  std::vector<std::vector<std::string>> rows;
  for (std::string line; std::getline(stream, line);) {
    ASSERT_EQ(line.back(), '\r');  // As of RFC 4180.
    line.pop_back();
    rows.push_back(test::cells_of(line));
  }
  ASSERT_EQ(rows.size(), 6U);
  EXPECT_EQ(rows[0][0], "run_index");
  EXPECT_EQ(rows[0][4], "truth_a_c11_delta_x_m");
  EXPECT_EQ(rows[0][33], "error_k2c_s2_m");
  EXPECT_EQ(rows[0][34], "health_acceleration_m_s2");
  EXPECT_EQ(rows[0][40], "loss_session");
  const std::vector<RunResult> results = test::results_in(store_);
  for (std::size_t run = 0; run < results.size(); ++run) {
    const auto& row = rows[run + 1];
    ASSERT_EQ(row.size(), 41U);
    EXPECT_EQ(row[0], std::to_string(run));
    EXPECT_EQ(row[2], "2");
    EXPECT_EQ(row[3], "3");
    for (std::size_t i = 0; i < num_parameters; ++i) {
      const RunResult& result = results[run];
      EXPECT_EQ(row[4 + i].empty(), !result.has_truth());
      EXPECT_EQ(row[14 + i].empty(), !result.has_estimate());
      EXPECT_EQ(row[24 + i].empty(), !result.has_estimate());
      if (!result.has_estimate()) continue;
      EXPECT_EQ(test::bits_of(test::number(row[4 + i])), test::bits_of(result.truth[i]));
      EXPECT_EQ(test::bits_of(test::number(row[14 + i])), test::bits_of(result.estimate[i]));
      EXPECT_EQ(test::bits_of(test::number(row[24 + i])),
                test::bits_of(result.estimate[i] - result.truth[i]));
    }
  }
  EXPECT_EQ(rows[1][1], "completed");
  EXPECT_EQ(rows[4][1], "no_draw");
}

TEST_F(Export, OfJsonHoldsCampaignColumnsRunsAndDigest) {
  const auto parsed = nlohmann::json::parse(json());
  EXPECT_EQ(parsed["campaign"]["name"], "hardy2013");
  EXPECT_EQ(parsed["campaign"]["seed"], "1");
  EXPECT_EQ(parsed["campaign"]["num_runs"], 5);
  EXPECT_EQ(parsed["campaign"]["definition"], store_.definition());
  EXPECT_EQ(parsed["num_finished"], 5);
  EXPECT_EQ(parsed["digest"], digest_of(store_));
  EXPECT_EQ(parsed["columns"].size(), 35U);
  EXPECT_EQ(parsed["columns"][3]["unit"], "rad");
  const RunResult result = test::result_of(0);
  EXPECT_EQ(test::bits_of(parsed["runs"][0]["estimate_k2d_s2_m"]),
            test::bits_of(result.estimate[8]));
  EXPECT_EQ(test::bits_of(parsed["runs"][0]["error_a_c12_rad"]),
            test::bits_of(result.estimate[3] - result.truth[3]));
  EXPECT_EQ(parsed["runs"][1]["status"], "not_converged");
  EXPECT_FALSE(parsed["runs"][2]["truth_k2d_s2_m"].is_null());
  EXPECT_TRUE(parsed["runs"][2]["estimate_k2d_s2_m"].is_null());
  EXPECT_TRUE(parsed["runs"][3]["truth_k2d_s2_m"].is_null());
  EXPECT_EQ(parsed["runs"][4].size(), 41U);
}

/// A lost run, one that is completed, and one of an older program, without health.
Store store_with_health(const std::filesystem::path& file) {
  std::vector<Delivery> deliveries = test::deliveries_of(0, 3);
  RunResult& lost = deliveries[0].result;
  lost.status = RunStatus::lost;
  lost.health = test::values_of({2e-5, 1.0 / 3.0, 1e-12, 0.25, 1e90});
  lost.loss = test::loss_of(LossCause::saturation, SessionTarget::k2_sensor_1);
  deliveries[1].result.health = test::values_of({1e-7, 2e-5, 1e-12, 0.25, 3e-4});
  Store store = test::store_of(file, test::campaign_of(3), {});
  (void)store.commit(deliveries);
  return store;
}

TEST_F(Export, OfCsvHasHealthAndWhereARunWasLost) {
  const Store store = store_with_health(directory() / "lost.db");
  TextOutput text(output());
  export_csv(store, text, test::never_stopped);
  const std::string content = test::content_of(output());
  EXPECT_THAT(content, HasSubstr(",health_acceleration_m_s2,health_attitude_rad,"
                                 "health_residual_m_s2,health_quadratic_noise,health_square_noise,"
                                 "loss_cause,loss_session\r\n0,lost,"));
  EXPECT_THAT(content,
              HasSubstr(",2e-05,0.3333333333333333,1e-12,0.25,1e+90,saturation,k2_sensor_1\r\n"));
  EXPECT_THAT(content, HasSubstr(",1e-07,2e-05,1e-12,0.25,0.0003,,\r\n2,completed,"));
  EXPECT_THAT(content, EndsWith(",,,,,,,\r\n"));
}

TEST_F(Export, OfJsonHasHealthAndWhereARunWasLost) {
  const Store store = store_with_health(directory() / "lost.db");
  TextOutput text(output());
  export_json(store, text, test::never_stopped);
  const auto runs = nlohmann::json::parse(test::content_of(output()))["runs"];
  EXPECT_EQ(runs[0]["status"], "lost");
  EXPECT_EQ(runs[0]["health_attitude_rad"], 1.0 / 3.0);
  EXPECT_EQ(runs[0]["loss_cause"], "saturation");
  EXPECT_EQ(runs[0]["loss_session"], "k2_sensor_1");
  EXPECT_TRUE(runs[1]["loss_cause"].is_null());
  EXPECT_EQ(runs[1]["health_square_noise"], 3e-4);
  EXPECT_TRUE(runs[2]["health_square_noise"].is_null());
}

TEST_F(Export, OfJsonHasALineARun) {
  const std::string text = json();
  EXPECT_EQ(std::ranges::count(text, '\n'), 11);
  EXPECT_THAT(text, HasSubstr("\n{\"run_index\":4,\"status\":\"completed\",\"num_draws\":2,"));
}

TEST_F(Export, OfNoRunIsWhole) {
  Store empty = Store::create(directory() / "empty.db", test::campaign_of(1), "");
  TextOutput text(output());
  export_json(empty, text, test::never_stopped);
  const auto json = nlohmann::json::parse(test::content_of(output()));
  EXPECT_EQ(json["runs"].size(), 0U);
  EXPECT_EQ(json["num_finished"], 0);
}

TEST_F(Export, CanBeInterrupted) {
  const auto stopped = [] { return true; };
  EXPECT_THROW(
      {
        TextOutput text(output());
        export_csv(store_, text, stopped);
      },
      Interrupted);
  EXPECT_THROW(
      {
        TextOutput text(output());
        export_json(store_, text, stopped);
      },
      Interrupted);
  EXPECT_THROW(export_hdf5(store_, output(), stopped), Interrupted);
  EXPECT_FALSE(file_names().contains("output"));
  EXPECT_THAT(file_names(), Each(Not(EndsWith(".new"))));
}

// Runs that a coordinator adds meanwhile would otherwise follow for ever.
TEST_F(Export, IsOfOneInstant) {
  Store store = test::store_of(directory() / "b.db", test::campaign_of(9), {});
  (void)store.commit(test::deliveries_of(0, 3));
  const Store reader = Store::open_read_only(directory() / "b.db");
  std::uint64_t num_runs = 0;
  walk_results(reader, test::never_stopped, [&](const RunResult&) {
    if (num_runs++ == 0) (void)store.commit(test::deliveries_of(3, 9));
  });
  EXPECT_EQ(num_runs, 3U);
}

/// What h5py, another reader of the format than the library's own functions, has read.
nlohmann::json read_by_h5py(const std::filesystem::path& file, const std::filesystem::path& text) {
  const std::string command = std::string("/usr/bin/python3 '") + PROOFMASS_READ_HDF5 + "' '" +
                              file.string() + "' > '" + text.string() + "' 2>&1";
  const int status = std::system(command.c_str());
  EXPECT_EQ(status, 0) << test::content_of(text);
  return status == 0 ? nlohmann::json::parse(test::content_of(text)) : nlohmann::json();
}

TEST_F(Export, OfHdf5HasHealthAndWhereARunWasLost) {
  const Store store = store_with_health(directory() / "lost.db");
  export_hdf5(store, output(), test::never_stopped);
  const auto read = read_by_h5py(output(), directory() / "read");
  EXPECT_EQ(read["status"], nlohmann::json({"lost", "completed", "completed"}));
  EXPECT_EQ(read["loss_cause"], nlohmann::json({"saturation", "none", "none"}));
  EXPECT_EQ(read["loss_session"], nlohmann::json({"k2_sensor_1", "none", "none"}));
  EXPECT_EQ(read["units"]["health/residual_m_s2"], "m/s²");
  EXPECT_EQ(read["bits"]["health/attitude_rad"][0], test::bits_of(1.0 / 3.0));
  EXPECT_TRUE(read["bits"]["health/attitude_rad"][2].is_null());
}

TEST_F(Export, OfHdf5IsReadByAnotherProgram) {
  export_hdf5(store_, output(), test::never_stopped);
  const auto read = read_by_h5py(output(), directory() / "read");
  EXPECT_EQ(read["attributes"]["name"], "hardy2013");
  EXPECT_EQ(read["attributes"]["seed"], 1);
  EXPECT_EQ(read["attributes"]["num_runs"], 5);
  EXPECT_EQ(read["attributes"]["num_finished"], 5);
  EXPECT_EQ(read["attributes"]["digest"], digest_of(store_));
  EXPECT_EQ(read["attributes"]["definition"], store_.definition());
  EXPECT_EQ(read["attributes"]["model_version"], store_.model_version());
  EXPECT_EQ(read["run_index"], nlohmann::json({0, 1, 2, 3, 4}));
  EXPECT_EQ(read["status"],
            nlohmann::json({"completed", "not_converged", "not_finite", "no_draw", "completed"}));
  EXPECT_EQ(read["num_draws"], nlohmann::json({2, 2, 2, 2, 2}));
  EXPECT_EQ(read["units"]["error/k2d_s2_m"], "s²/m");
  const RunResult result = test::result_of(1);
  EXPECT_EQ(read["bits"]["truth/a_c12_rad"][1], test::bits_of(result.truth[3]));
  EXPECT_EQ(read["bits"]["estimate/k2c_s2_m"][1], test::bits_of(result.estimate[9]));
  EXPECT_EQ(read["bits"]["error/a_d11_prime"][1],
            test::bits_of(result.estimate[5] - result.truth[5]));
  EXPECT_TRUE(read["bits"]["estimate/a_c12_rad"][2].is_null());
  EXPECT_FALSE(read["bits"]["truth/a_c12_rad"][2].is_null());
  EXPECT_TRUE(read["bits"]["truth/a_c12_rad"][3].is_null());
  EXPECT_EQ(read["bits"].size(), 35U);
}

// More rows than are written at a time.
TEST_F(Export, OfHdf5HoldsManyRuns) {
  constexpr std::uint64_t num_runs = 40'000;
  Store store = Store::create(directory() / "many.db", test::campaign_of(num_runs), "");
  (void)store.commit(test::deliveries_of(0, num_runs));
  export_hdf5(store, output(), test::never_stopped);
  const std::string script =
      "import h5py, numpy, sys; f = h5py.File(sys.argv[1]); i = f['run_index'][:]; t = "
      "f['truth/a_c11_delta_x_m'][:]; sys.exit(not (len(i) == len(t) == 40000 and (i == "
      "numpy.arange(40000)).all() and (t == (i + 1.0) / 3.0).all()))";
  EXPECT_EQ(std::system(("/usr/bin/python3 -c \"" + script + "\" " + output().string()).c_str()),
            0);
}

TEST_F(Export, OfHdf5SaysWhyItCannotBeWritten) {
  const std::string path = (directory() / "no" / "a.h5").string();
  const std::string error = test::error_of([&] { export_hdf5(store_, path, test::never_stopped); });
  EXPECT_EQ(error, "output = " + path + " (cannot be written: No such file or directory)");
}

TEST_F(Export, OfHdf5DoesNotAppearOnAFullDisk) {
  std::string error;
  {
    const test::FileSizeLimit limit(4096);
    error = test::error_of([&] { export_hdf5(store_, output(), test::never_stopped); });
  }
  EXPECT_EQ(error, "output = " + output().string() + " (cannot be written: File too large)");
  EXPECT_FALSE(file_names().contains("output"));
  EXPECT_THAT(file_names(), Each(Not(EndsWith(".new"))));
}

}  // namespace
}  // namespace proofmass::coordinator
