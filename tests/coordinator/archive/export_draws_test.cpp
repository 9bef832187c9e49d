#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/archive/export.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/coordinator/query/query_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::HasSubstr;

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
    const auto text = directory() / "read";
    EXPECT_EQ(std::system(fmt::format("/usr/bin/python3 '{}' '{}' > '{}' 2>&1", PROOFMASS_READ_HDF5,
                                      output().string(), text.string())
                              .c_str()),
              0)
        << test::content_of(text);
    return nlohmann::json::parse(test::content_of(text));
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

TEST_F(ExportDraws, AreThoseOfTheTableOfQuery) {
  test::RecordingWriter writer;
  ASSERT_EQ(run_query(file(), "SELECT run_index, quantity, value FROM draw", {}, writer),
            QueryEnd::complete);
  Bits asked;
  for (const auto& row : writer.rows) {
    const auto* value = std::get_if<double>(&row[2]);
    asked[{static_cast<std::uint64_t>(std::get<std::int64_t>(row[0])),
           std::get<std::string>(row[1])}] =
        value == nullptr ? std::nullopt : std::optional(test::bits_of(*value));
  }
  ASSERT_EQ(asked.size(), num_runs * num_drawn);
  std::erase_if(asked,
                [](const auto& entry) { return entry.first.first == 3 || entry.first.first == 7; });
  EXPECT_EQ(expected_, asked);
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

TEST_F(ExportDraws, SayThatADefinitionIsNoCampaign) {
  Store store = Store::create(directory() / "bad.db", test::campaign_of(2), "name = 1");
  EXPECT_THAT(test::error_of([&] {
                export_hdf5(store, output(), test::never_stopped, DrawColumns::included);
              }),
              HasSubstr("stored definition:1: name = 1 (unknown key"));
}

}  // namespace
}  // namespace proofmass::coordinator
