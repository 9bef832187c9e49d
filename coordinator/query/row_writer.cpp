#include "coordinator/query/row_writer.hpp"

#include <utility>

#include "coordinator/query/data_writers.hpp"
#include "coordinator/query/text_writers.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator {

std::unique_ptr<RowWriter> make_row_writer(RowFormat format, const TableLimits& limits,
                                           TextSink sink) {
  switch (format) {
    case RowFormat::table:
      return std::make_unique<TableWriter>(limits, std::move(sink));
    case RowFormat::csv:
      return std::make_unique<CsvWriter>(std::move(sink));
    case RowFormat::json:
      return std::make_unique<JsonWriter>(std::move(sink));
    case RowFormat::markdown:
      return std::make_unique<MarkdownWriter>(std::move(sink));
  }
  PROOFMASS_EXPECT(false);
  return nullptr;
}

}  // namespace proofmass::coordinator
