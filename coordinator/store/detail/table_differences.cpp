#include "coordinator/store/detail/table_differences.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

#include "coordinator/store/detail/schema.hpp"

namespace proofmass::coordinator::detail {
namespace {

struct Row {
  std::string name;
  std::vector<std::string> cells;
};

struct Content {
  std::vector<std::string> columns;
  std::vector<Row> rows;

  [[nodiscard]] const Row* find(const std::string& name) const {
    const auto found = std::ranges::find(rows, name, &Row::name);
    return found == rows.end() ? nullptr : &*found;
  }
};

Content content_of(const Database& database, const ComparedTable& table) {
  Statement select = database.prepare(
      fmt::format("SELECT {}, {} FROM {}", table.row_name, table.columns, table.name));
  Content content;
  for (int column = 1; column < select.num_columns(); ++column) {
    content.columns.push_back(select.column_name(column));
  }
  while (select.step()) {
    Row& row = content.rows.emplace_back(Row{.name = select.text(0), .cells = {}});
    for (int column = 1; column < select.num_columns(); ++column) {
      row.cells.push_back(select.shown(column));
    }
  }
  return content;
}

void compare(const ComparedTable& table, const Content& stored, const Content& expected,
             FurtherRows further, std::vector<std::string>& differences) {
  for (const Row& must : expected.rows) {
    const Row* const row = stored.find(must.name);
    if (row == nullptr) {
      differences.push_back(fmt::format("{} lacks {}", table.name, must.name));
      continue;
    }
    for (std::size_t i = 0; i < must.cells.size(); ++i) {
      if (row->cells[i] == must.cells[i]) continue;
      differences.push_back(fmt::format("{}.{} of {} = {} (must be {})", table.name,
                                        expected.columns[i], must.name, row->cells[i],
                                        must.cells[i]));
    }
  }
  if (further == FurtherRows::ignore) return;
  for (const Row& row : stored.rows) {
    if (expected.find(row.name) != nullptr) continue;
    differences.push_back(fmt::format("{} has a row too many: {}", table.name, row.name));
  }
}

}  // namespace

std::vector<std::string> table_differences(const Database& database,
                                           const std::function<void(Database&)>& write,
                                           std::span<const ComparedTable> tables,
                                           FurtherRows further) {
  Database expected("new campaign", Access::memory);
  Transaction transaction(expected);
  migrate(expected);
  write(expected);
  std::vector<std::string> differences;
  for (const ComparedTable& table : tables) {
    compare(table, content_of(database, table), content_of(expected, table), further, differences);
  }
  return differences;
}

}  // namespace proofmass::coordinator::detail
