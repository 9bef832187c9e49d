#include "coordinator/archive/export.hpp"

#include <gmock/gmock.h>

#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/report/digest.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/coordinator/query/query_fixture.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::Each;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;

/// What h5py, another reader of the format than the library's own functions, has read.
nlohmann::json read_by_h5py(const std::filesystem::path& file, const std::filesystem::path& text) {
  const std::string command = std::string("/usr/bin/python3 '") + PROOFMASS_READ_HDF5 + "' '" +
                              file.string() + "' > '" + text.string() + "' 2>&1";
  const int status = std::system(command.c_str());
  EXPECT_EQ(status, 0) << test::content_of(text);
  return status == 0 ? nlohmann::json::parse(test::content_of(text)) : nlohmann::json();
}

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
  constexpr std::uint64_t num_many = 40'000;
  Store store = Store::create(directory() / "many.db", test::campaign_of(num_many), "");
  (void)store.commit(test::deliveries_of(0, num_many));
  export_hdf5(store, output(), test::never_stopped);
  const std::string script =
      "import h5py, numpy, sys; f = h5py.File(sys.argv[1]); i = f['run_index'][:]; t = "
      "f['truth/a_c11_delta_x_m'][:]; sys.exit(not (len(i) == len(t) == 40000 and (i == "
      "numpy.arange(40000)).all() and (t == (i + 1.0) / 3.0).all()))";
  EXPECT_EQ(std::system(("/usr/bin/python3 -c \"" + script + "\" " + output().string()).c_str()),
            0);
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

constexpr std::uint64_t num_runs = 24;
constexpr std::uint64_t run_without_draw = 5;
constexpr std::size_t table_element = 25;

/// Laws of several kinds, two of them tables; wide misalignments, so that many a draw is rejected;
/// a scale factor that is never accepted in one run.
MicroscopeCampaign varied_campaign(std::uint64_t count = num_runs) {
  MicroscopeCampaign campaign = test::campaign_of(count);
  campaign.seed = 20260314;
  auto& laws = campaign.dispersions;
  for (std::size_t i = 6; i < 12; ++i) {
    laws[i].minimum *= 1.5;
    laws[i].maximum *= 1.5;
  }
  laws[24].law = Law::normal;
  laws[24].standard_deviation = 1e-5;
  laws[0] = {.law = Law::table, .file = "a.csv", .column = "scale"};
  laws[table_element] = {.law = Law::table, .file = "a.csv", .column = "y"};
  campaign.table_columns.resize(2);
  for (std::uint64_t run = 0; run < count; ++run) {
    campaign.table_columns[0].push_back(run == run_without_draw ? 0.9 : 0.0);
    campaign.table_columns[1].push_back(1e-5 / (3.0 + static_cast<double>(run)));
  }
  return campaign;
}

/// Bits of the drawn values of each run, nothing for a run without; by run index and quantity.
using Bits = std::map<std::pair<std::uint64_t, std::string>, std::optional<std::uint64_t>>;

/// Drawn once more, by the laws and the rule of acceptance alone.
Bits drawn_again(const MicroscopeCampaign& campaign, const std::vector<std::uint64_t>& runs) {
  Bits bits;
  for (const std::uint64_t run : runs) {
    std::optional<DrawnValues> accepted;
    for (std::uint32_t draw = 0; draw < num_draws_max && !accepted; ++draw) {
      const std::vector<double> row{campaign.table_columns[0][run], campaign.table_columns[1][run]};
      const DrawnValues values = draw_values(campaign.dispersions, campaign.seed, {run}, draw, row);
      if (is_accepted(make_instrument(values), campaign.scenario.acceptance)) accepted = values;
    }
    for (std::size_t i = 0; i < num_drawn; ++i) {
      bits[{run, drawn_names()[i]}] =
          accepted ? std::optional(test::bits_of((*accepted)[i])) : std::nullopt;
    }
  }
  return bits;
}

class ExportDraws : public test::StoreTest {
 protected:
  // Runs 3 and 7 have no result yet.
  ExportDraws() {
    std::vector<RunResult> results;
    for (std::uint64_t run = 0; run < num_runs; ++run) {
      if (run == 3 || run == 7) continue;
      runs_.push_back(run);
      results.push_back(test::result_of(run, static_cast<RunStatus>(1 + run % 3)));
    }
    (void)test::store_of(file(), varied_campaign(), results);
    expected_ = drawn_again(varied_campaign(), runs_);
  }

  [[nodiscard]] std::filesystem::path output() const { return directory() / "output"; }

  /// The columns `draw/` of an export, as h5py reads them.
  [[nodiscard]] nlohmann::json exported(const Store& store,
                                        const IsStopped& is_stopped = test::never_stopped) const {
    export_hdf5(store, output(), is_stopped, DrawColumns::included);
    return read_by_h5py(output(), directory() / "read");
  }

  [[nodiscard]] Bits bits_in(const nlohmann::json& read) const {
    EXPECT_EQ(read["run_index"].size(), runs_.size());
    Bits bits;
    for (const std::string& name : drawn_names()) {
      const auto& column = read["bits"].at("draw/" + name);
      EXPECT_EQ(column.size(), runs_.size());
      for (std::size_t i = 0; i < runs_.size(); ++i) {
        bits[{runs_[i], name}] =
            column[i].is_null() ? std::nullopt : std::optional(column[i].get<std::uint64_t>());
      }
    }
    return bits;
  }

  std::vector<std::uint64_t> runs_;  ///< Those with a result.
  Bits expected_;
};

// The run without a draw among them has no values, and no run without a result has a row.
TEST_F(ExportDraws, AreThoseOfAnIndependentDrawWithUnits) {
  const nlohmann::json read = exported(Store::open_read_only(file()));
  const Bits bits = bits_in(read);
  EXPECT_EQ(bits, expected_);
  EXPECT_FALSE((bits.at({run_without_draw, drawn_names()[0]}).has_value()));
  EXPECT_EQ((bits.at({23, drawn_names()[table_element]})), test::bits_of(1e-5 / 26.0));
  EXPECT_EQ(read["bits"].size(), 35U + num_drawn);
  EXPECT_EQ(read["units"]["draw/offcentring_m.x"], "m");
  EXPECT_EQ(read["units"]["draw/scale_factor_error.sensor_1_x"], "1");
}

// A campaign that grows while it is exported, run by run, is drawn as it was when the export began.
TEST_F(ExportDraws, AreOfTheStateThatTheRunsAreOf) {
  Store growing = Store::open(file());
  const auto grow = [&, is_first = true]() mutable {
    if (!std::exchange(is_first, false)) return false;
    const MicroscopeCampaign more = varied_campaign(num_runs + 1);
    growing.extend(more, canonical_definition(more));
    (void)growing.commit(test::deliveries_of(num_runs, num_runs + 1));
    return false;
  };
  const Store store = Store::open_read_only(file());
  EXPECT_EQ(bits_in(exported(store, grow)), expected_);

  runs_.push_back(num_runs);
  EXPECT_EQ(bits_in(exported(Store::open_read_only(file()))),
            drawn_again(varied_campaign(num_runs + 1), runs_));
}

}  // namespace
}  // namespace proofmass::coordinator
