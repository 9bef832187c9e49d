#include "coordinator/store/detail/annotation_rows.hpp"

#include <fmt/format.h>
#include <utf8.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <variant>

#include "coordinator/store/store_error.hpp"
#include "core/error.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator::detail {
namespace {

constexpr std::size_t tag_size_max = 64;
constexpr std::size_t note_size_max = 2000;
constexpr std::int64_t num_tags_max = 100;
constexpr std::int64_t num_notes_max = 1000;

bool is_tag_character(char c) {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '.' ||
         c == '_' || c == '-';
}

void check_tag(std::string_view tag) {
  const bool is_good = !tag.empty() && tag.size() <= tag_size_max &&
                       std::all_of(tag.begin(), tag.end(), is_tag_character);
  if (is_good) return;
  throw InvalidArgument(fmt::format(
      "tag = {} (must be 1 to {} of the characters A-Z a-z 0-9 . _ -)", tag, tag_size_max));
}

bool is_control_character(std::uint32_t character) {
  return (character < 0x20 && character != U'\n') || (character >= 0x7f && character < 0xa0);
}

bool is_printable_utf8(std::string_view text) {
  if (!utf8::is_valid(text.begin(), text.end())) return false;
  for (auto at = text.begin(); at != text.end();) {
    if (is_control_character(utf8::unchecked::next(at))) return false;
  }
  return true;
}

void check_note(std::string_view text) {
  if (text.empty() || text.size() > note_size_max) {
    throw InvalidArgument(
        fmt::format("note = {} bytes (must be 1 to {} bytes)", text.size(), note_size_max));
  }
  if (!is_printable_utf8(text)) {
    throw InvalidArgument(
        fmt::format("note = {} bytes (must be UTF-8 without control characters but the end of a "
                    "line)",
                    text.size()));
  }
}

/// @pre A row was added; it goes with the transaction.
void check_count(const Database& database, std::string_view table, std::int64_t num_rows_max) {
  const std::int64_t num_rows = database.integer(fmt::format("SELECT count(*) FROM {}", table));
  if (num_rows <= num_rows_max) return;
  throw StoreError(
      fmt::format("{}s = {} (a campaign has at most {})", table, num_rows, num_rows_max));
}

void write(const Database& database, const AddTag& added) {
  check_tag(added.tag);
  database.prepare("INSERT INTO tag (tag) VALUES (?) ON CONFLICT DO NOTHING").run(added.tag);
  check_count(database, "tag", num_tags_max);
}

void write(const Database& database, const RemoveTag& removed) {
  check_tag(removed.tag);
  database.prepare("DELETE FROM tag WHERE tag = ?").run(removed.tag);
  if (database.num_changes() > 0) return;
  throw StoreError(fmt::format("tag = {} (is none of this campaign)", removed.tag));
}

void write(const Database& database, const AddNote& added) {
  check_note(added.text);
  database.prepare("INSERT INTO note (text) VALUES (?)").run(added.text);
  check_count(database, "note", num_notes_max);
}

}  // namespace

void write_annotation(const Database& database, const Annotation& annotation) {
  std::visit([&](const auto& kind) { write(database, kind); }, annotation);
}

std::vector<std::string> read_tags(const Database& database) {
  Statement select = database.prepare("SELECT tag FROM tag ORDER BY tag");
  std::vector<std::string> tags;
  while (select.step()) {
    tags.push_back(select.text(0));
    if (wire::visible_text(tags.back()) == tags.back()) continue;
    select.refuse_as_damaged(fmt::format("tag = {}", tags.back()));
  }
  return tags;
}

std::vector<Note> read_notes(const Database& database) {
  Statement select = database.prepare("SELECT time_utc, text FROM note ORDER BY note_id");
  std::vector<Note> notes;
  while (select.step()) notes.push_back({.time_utc = select.text(0), .text = select.text(1)});
  return notes;
}

}  // namespace proofmass::coordinator::detail
