#pragma once

#include "coordinator/query/query.hpp"
#include "coordinator/store/store.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::test {

/// A value of SQL that keeps its text; bytes are text here.
using OwnCell = std::variant<std::monostate, std::int64_t, double, std::string>;

/// Keeps what a query yields.
class RecordingWriter : public coordinator::RowWriter {
 public:
  std::vector<std::string> columns;
  std::vector<std::vector<OwnCell>> rows;
  bool has_ended = false;
  std::size_t num_wanted = std::numeric_limits<std::size_t>::max();

  void begin(std::span<const std::string> names) override {
    columns.assign(names.begin(), names.end());
  }
  [[nodiscard]] bool row(std::span<const coordinator::Value> cells) override {
    auto& own = rows.emplace_back();
    for (const coordinator::Value& cell : cells) own.push_back(own_cell(cell));
    return rows.size() < num_wanted;
  }
  void end() override { has_ended = true; }

 private:
  static OwnCell own_cell(const coordinator::Value& cell) {
    if (const auto* integer = std::get_if<std::int64_t>(&cell)) return *integer;
    if (const auto* real = std::get_if<double>(&cell)) return *real;
    if (const auto* text = std::get_if<std::string_view>(&cell)) return std::string(*text);
    if (const auto* blob = std::get_if<coordinator::Blob>(&cell)) return std::string(blob->bytes);
    return std::monostate();
  }
};

/// A test with a campaign database.
class QueryTest : public StoreTest {
 protected:
  /// Makes the file, with results of the first runs.
  void make_file(const MicroscopeCampaign& campaign, std::uint64_t num_results = 0) {
    coordinator::Store store =
        coordinator::Store::create(file(), campaign, canonical_definition(campaign));
    const coordinator::Entry worker = worker_1();
    store.write({&worker, 1});
    store.commit(deliveries_of(0, num_results));
  }

  [[nodiscard]] std::vector<std::vector<OwnCell>> rows_of(const std::string& sql) const {
    RecordingWriter writer;
    const auto end = coordinator::run_query(file(), sql, {}, writer);
    EXPECT_EQ(end, coordinator::QueryEnd::complete);
    EXPECT_TRUE(writer.has_ended);
    return writer.rows;
  }
  [[nodiscard]] double number_of(const std::string& sql) const {
    return std::get<double>(rows_of(sql).at(0).at(0));
  }
  /// Text of the QueryError; empty if there is none.
  [[nodiscard]] std::string error_of(const std::string& sql) const {
    RecordingWriter writer;
    try {
      (void)coordinator::run_query(file(), sql, {}, writer);
    } catch (const coordinator::QueryError& error) {
      return error.what();
    }
    return {};
  }
};

}  // namespace proofmass::test
