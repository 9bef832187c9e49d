#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace proofmass {

/// What has_name_form() wants, for messages: `must be 1 to 64 of ` and this.
inline constexpr std::string_view name_rule = "[A-Za-z0-9._-], a letter or digit first";
/// What is_name() wants.
inline constexpr std::size_t name_length_max = 128;
inline constexpr std::string_view is_name_rule =
    "must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first";

/// True for [A-Za-z0-9._-], whatever the locale.
[[nodiscard]] bool may_be_in_name(char c);

/// True if the text is made of such characters and begins with a letter or digit. Such a name is no
/// option, no directory and no hidden file, and stands in files, logs and addresses as it is.
[[nodiscard]] bool has_name_form(std::string_view text);

/// True for 1 to 128 characters of which has_name_form() holds: names of workers, hosts and models,
/// which go into messages, logs and the database as they are.
[[nodiscard]] bool is_name(std::string_view text);

/// Files of older programs may have names that begin with another character; they stay readable.
enum class NameOrigin : std::uint8_t { given, stored };

/// @throws ConfigError `campaign.name = "..." (rule)` unless it is a campaign's name.
void check_campaign_name(const std::string& name, NameOrigin origin);

}  // namespace proofmass
