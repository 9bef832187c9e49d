#include "coordinator/archive/export.hpp"

#include <gmock/gmock.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "coordinator/report/digest.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::Each;
using ::testing::EndsWith;
using ::testing::Not;

class Export : public test::StoreTest {
 protected:
  Export()
      : store_(test::store_of(file(), test::campaign_of(5), test::results_of_each_status(5))) {}

  [[nodiscard]] std::filesystem::path output() const { return directory() / "output"; }

  Store store_;
};

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

TEST_F(Export, CanBeInterrupted) {
  EXPECT_THROW(export_hdf5(store_, output(), [] { return true; }), Interrupted);
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

TEST_F(Export, OfNoRunIsWhole) {
  const Store empty = Store::create(directory() / "empty.db", test::campaign_of(1), "");
  export_hdf5(empty, output(), test::never_stopped);
  const auto read = read_by_h5py(output(), directory() / "read");
  EXPECT_EQ(read["run_index"].size(), 0U);
  EXPECT_EQ(read["attributes"]["num_finished"], 0);
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
