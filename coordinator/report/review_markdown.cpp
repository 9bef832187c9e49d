#include "coordinator/report/review_markdown.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "coordinator/report/report_tables.hpp"
#include "coordinator/report/review_summary.hpp"
#include "coordinator/report/review_tables.hpp"
#include "coordinator/table/markdown_table.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

/// In a code span nothing is escaped but what ends it and the cell.
std::string code_span(std::string_view text) {
  std::string span;
  for (const char c : wire::visible_text(text)) {
    if (c == '|') span += '\\';
    span += c == '`' ? '\'' : c;
  }
  return "`" + span + "`";
}

std::string section(std::string_view title, std::initializer_list<Table> tables) {
  std::string text;
  for (const Table& table : tables) {
    if (!table.rows.empty()) text += markdown_table(table);
  }
  return text.empty() ? "" : fmt::format("## {}\n\n{}", title, text);
}

}  // namespace

std::string review_markdown(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  std::string text = fmt::format("# Campaign {}\n\n", markdown_text(review.identity.name));
  for (const auto& [sentence, source] : review_summary(review)) {
    text += fmt::format("- {} ({})\n", markdown_text(sentence), source);
  }
  text += "\n";
  text +=
      section("Verification matrix", {matrix_table(review)}) +
      section("Accuracy", {accuracy_table(review.objectives, statistics),
                           interval_table(statistics, review.num_given_up),
                           error_table(statistics, review.num_given_up, review.interpretation)}) +
      section("Budget", {review_budget_table(review)}) +
      section("Causes of the errors", {cause_table(review)}) +
      section("How it was run",
              {identity_table(review), execution_table(review), host_table(review)}) +
      "## How to reproduce it\n\n";
  for (const auto& [command, effect] : reproducing_commands(review)) {
    text += fmt::format("- {} {}\n", code_span(command), markdown_text(effect));
  }
  return text;
}

}  // namespace proofmass::coordinator
