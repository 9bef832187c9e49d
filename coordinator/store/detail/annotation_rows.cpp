#include "coordinator/store/detail/annotation_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <variant>

#include "coordinator/store/store_error.hpp"

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
  throw StoreError(fmt::format("tag = {} (must be 1 to {} of the characters A-Z a-z 0-9 . _ -)",
                               tag, tag_size_max));
}

bool is_control_character(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return (byte < 0x20 && c != '\n') || byte == 0x7f;
}

/// The smallest code point that needs so many bytes, by their number; shorter forms are forbidden.
constexpr std::array<std::uint32_t, 5> code_point_min{0, 0, 0x80, 0x800, 0x10000};

std::size_t size_of_character(unsigned char first) {
  if (first < 0x80) return 1;
  if (first >= 0xc2 && first < 0xe0) return 2;
  if (first >= 0xe0 && first < 0xf0) return 3;
  if (first >= 0xf0 && first < 0xf5) return 4;
  return 0;
}

/// Bytes of the character that a text begins with; 0 if it is not UTF-8 [RFC 3629].
std::size_t valid_character(std::string_view text) {
  const std::size_t size = size_of_character(static_cast<unsigned char>(text.front()));
  if (size <= 1 || size > text.size()) return size <= text.size() ? size : 0;
  std::uint32_t code_point = static_cast<unsigned char>(text.front()) & (0xffU >> (size + 1));
  for (const char c : text.substr(1, size - 1)) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte & 0xc0) != 0x80) return 0;
    code_point = (code_point << 6) | (byte & 0x3fU);
  }
  const bool is_surrogate = code_point >= 0xd800 && code_point < 0xe000;
  const bool is_control = code_point >= 0x80 && code_point < 0xa0;
  const bool is_good = code_point >= code_point_min[size] && code_point < 0x110000;
  return is_good && !is_surrogate && !is_control ? size : 0;
}

bool is_printable_utf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t size = is_control_character(text.front()) ? 0 : valid_character(text);
    if (size == 0) return false;
    text.remove_prefix(size);
  }
  return true;
}

void check_note(std::string_view text) {
  if (text.empty() || text.size() > note_size_max) {
    throw StoreError(
        fmt::format("note = {} bytes (must be 1 to {} bytes)", text.size(), note_size_max));
  }
  if (!is_printable_utf8(text)) {
    throw StoreError(
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
  while (select.step()) tags.push_back(select.text(0));
  return tags;
}

std::vector<Note> read_notes(const Database& database) {
  Statement select = database.prepare("SELECT time_utc, text FROM note ORDER BY note_id");
  std::vector<Note> notes;
  while (select.step()) notes.push_back({.time_utc = select.text(0), .text = select.text(1)});
  return notes;
}

}  // namespace proofmass::coordinator::detail
