#pragma once

#include <toml++/toml.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/definition.hpp"
#include "core/campaign/field.hpp"

namespace proofmass {

/// A value given on the command line; it hides the file's value at the same path.
struct Assignment {
  std::string origin;  ///< For messages: `--set noise.scale=0`.
  std::string path;
  toml::table holder;  ///< The value, under the key `value`.
};

/// The assignment of `key=value`; the value is TOML, or else a text without quotes.
/// @throws DefinitionError if there is no key or no `=`.
[[nodiscard]] Assignment parse_assignment(const std::string& text);

/// Whether messages name the line of what is wrong; nobody sees those of a text that was written
/// from another format.
enum class Lines : std::uint8_t { named, left_out };

/// A parsed campaign file that remembers which paths were asked for and what was refused, so that
/// keys that nobody asked for are found and the first error in the file is the one reported.
///
/// A path is `estimation.transient_s` or `session[2].excitations[0].axis`.
class Document {
 public:
  /// @param name  For messages: the path of the file.
  /// @throws DefinitionError at the first place that is not TOML.
  Document(std::string name, std::string_view text, std::vector<Assignment> assignments,
           Lines lines = Lines::named);

  /// The value at a path, null if absent; the path is a key from now on.
  [[nodiscard]] const toml::node* find(const std::string& path);

  [[nodiscard]] bool is_assigned(const std::string& path) const;

  /// Whether the file has something at a path, or an assignment below it; which of it are keys is
  /// left to who reads them.
  [[nodiscard]] bool has_table(const std::string& path) const;

  /// Entries of a list of tables such as `session`; nothing if absent, or if there are more than
  /// `count_max`, which is refused.
  [[nodiscard]] std::optional<std::size_t> num_tables(const std::string& path,
                                                      std::size_t count_max);

  // Each leaves the value alone and returns false if the path is absent, or if what stands there is
  // refused: then the refusal is remembered.
  bool read(const std::string& path, double& value, const Range& range = range::any);
  bool read(const std::string& path, std::int64_t& value, const Range& range = range::any);
  bool read(const std::string& path, std::uint64_t& value, const Range& range);  ///< Not below 0.
  bool read(const std::string& path, int& value);
  bool read(const std::string& path, bool& value);
  bool read(const std::string& path, std::string& value);

  /// Reads an enumerator by its spelling.
  template <typename Choice>
  requires std::is_enum_v<Choice>
  bool read(const std::string& path, Choice& value) {
    const std::optional<std::size_t> position = read_choice(path, names_of(value));
    if (position) value = static_cast<Choice>(*position + 1);
    return position.has_value();
  }

  /// Reads what must be there: its absence is refused.
  template <typename Value>
  bool read_needed(const std::string& path, Value& value) {
    if (find(path) != nullptr) return read(path, value);
    refuse_absence(path, "must be given");
    return false;
  }

  /// Remembers that the value at a path breaks a rule.
  void refuse(const std::string& path, std::string_view rule);
  /// Remembers that a key is absent although it is needed.
  void refuse_absence(const std::string& path, std::string_view rule);

  /// @throws DefinitionError for the first refused value or key that nobody asked for.
  void check() const;

  /// The error with the place of its field in front.
  [[nodiscard]] DefinitionError located(const ConfigError& error) const;

 private:
  // Where a path stands: in an assignment, or in the file.
  struct Place {
    std::size_t assignment = 0;  // From 1; 0 for the file, which sorts first.
    std::uint32_t line = 0;      // From 1; 0 if unknown.
    std::uint32_t column = 0;
    auto operator<=>(const Place&) const = default;
  };
  struct Refusal {
    Place place;
    std::string subject;  // `noise.scale = -1`, `session[0].name`.
    std::string path;
    std::string rule;  // Empty if the key is unknown.
    bool is_absence = false;
  };

  [[nodiscard]] std::optional<std::size_t> read_choice(const std::string& path,
                                                       std::span<const std::string_view> names);
  /// The value at a path, which becomes a key; null if absent, or if it is of another type: then it
  /// is refused with the rule.
  template <typename Value>
  const toml::value<Value>* find_value(const std::string& path, std::string_view rule);
  [[nodiscard]] const toml::node* value_at(const std::string& path) const;
  [[nodiscard]] Place place_of(std::string path) const;
  [[nodiscard]] std::string prefix(const Place& place) const;
  [[nodiscard]] DefinitionError error_of(const Refusal& refusal) const;
  [[nodiscard]] bool leads_to_keys(const std::string& path) const;
  void find_unknown_keys(const toml::node& content, const std::string& path,
                         std::optional<Refusal>& first) const;
  void refuse_unknown(const toml::node& content, const std::string& path,
                      std::optional<Refusal>& first) const;

  std::string name_;
  Lines lines_;
  toml::table root_;
  std::vector<Assignment> assignments_;
  std::set<std::string> keys_;
  std::vector<Refusal> refusals_;
};

}  // namespace proofmass
