#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/definition.hpp"
#include "core/campaign/dispersion.hpp"
#include "core/campaign/field.hpp"

namespace proofmass::detail {

/// A key of a campaign file, with its value as TOML.
struct Entry {
  std::string path;            ///< `estimation.transient_s`; in a list or of a law the key alone.
  std::string text;            ///< `1000`.
  std::string comment;         ///< Meaning and rule; may be empty.
  DefinitionValue value = {};  ///< What the text says.
};

[[nodiscard]] Entry text_entry(std::string_view path, std::string_view text,
                               std::string comment = {});
[[nodiscard]] Entry real_entry(std::string_view path, double value, std::string comment = {});
[[nodiscard]] Entry whole_entry(std::string_view path, std::int64_t value,
                                std::string comment = {});

/// An enumerator by its spelling.
template <typename Choice>
[[nodiscard]] Entry choice_entry(std::string_view path, Choice choice, std::string comment = {}) {
  return text_entry(path, name_of(choice), std::move(comment));
}

/// @param item_text  The text of an item.
template <typename Item, typename TextOf>
[[nodiscard]] Entry list_entry(std::string_view path, const std::vector<Item>& items,
                               const TextOf& item_text) {
  std::string text = "[";
  for (const Item& item : items) {
    if (text.size() > 1) text += ", ";
    text += item_text(item);
  }
  text += "]";
  return {std::string(path), text, "", text};
}

/// Keys and values, as Campaign::items() has them.
[[nodiscard]] std::vector<DefinitionItem> items_of(std::vector<Entry> entries);

enum class Comments : std::uint8_t { included, left_out };

/// The entries as TOML, with a table for each part of the paths before their last dot.
[[nodiscard]] std::string text_of(const std::vector<Entry>& entries,
                                  std::string_view between_tables = "\n",
                                  Comments comments = Comments::left_out);

/// What differs but for the number of runs, as Campaign::differences_from() has it. A key that one
/// side lacks is a difference, too; the names of data files and of their columns are none.
[[nodiscard]] std::vector<DefinitionDifference> differences_between(
    const std::vector<Entry>& first, const std::vector<Entry>& second);

/// The law and its own keys.
[[nodiscard]] std::vector<Entry> law_entries(const Dispersion& law);

/// Name, seed, runs and, where they are not the nominal ones, realisations and design: those that
/// came later are left out, so that the text of a campaign remains the one that it was stored with.
[[nodiscard]] std::vector<Entry> campaign_entries(const Campaign& campaign);

}  // namespace proofmass::detail
