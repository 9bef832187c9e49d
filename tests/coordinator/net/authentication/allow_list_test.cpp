#include <fmt/format.h>
#include <sys/stat.h>

#include "coordinator/net/authentication/authenticator.hpp"
#include "coordinator/net/authentication/rights.hpp"
#include "core/error.hpp"
#include "proto/link/keys.hpp"
#include "proto/link/whole_file.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using std::chrono::milliseconds;
using test::refusal_of;
using test::ScratchDirectory;
using test::write_text;

std::string new_key() { return wire::make_key_pair().public_key.text(); }

std::string parsing(const std::string& text) {
  return refusal_of([&] { (void)parse_allow_list(text, wire::KeyRole::worker, "keys"); });
}

std::string parsing_clients(const std::string& text) {
  return refusal_of([&] { (void)parse_allow_list(text, wire::KeyRole::client, "keys"); });
}

TEST(AllowListText, HasAKeyAndANameInEachLine) {
  const std::string one = new_key();
  const std::string two = new_key();
  const AllowedKeys keys = parse_allow_list("# workers\n\n" + one + " worker-1\n  " + two +
                                                "\tcluster.7 \r\n   \n#" + new_key() + " revoked\n",
                                            wire::KeyRole::worker, "keys");
  EXPECT_EQ(keys, (AllowedKeys{{one, {"worker-1", {}}}, {two, {"cluster.7", {}}}}));
  EXPECT_EQ(parse_allow_list(one + " last", wire::KeyRole::worker, "keys").size(), 1u);
  EXPECT_TRUE(parse_allow_list("", wire::KeyRole::worker, "keys").empty());
}

TEST(AllowListText, SaysWhichLineIsWrongAndNotWhatItSays) {
  const std::string key = new_key();
  const std::string fine = key + " a\n";
  EXPECT_EQ(parsing(fine + "\nkey b\n"),
            "keys line = 3 (must begin with a public key of 40 characters)");
  EXPECT_EQ(parsing("secret " + key + "\n"),
            "keys line = 1 (must begin with a public key of 40 characters)");
  for (const std::string name : {"", "a/b", "ü", "a\"b"}) {
    EXPECT_EQ(parsing(key + " " + name + "\n"),
              "keys line = 1 (must have a name of [A-Za-z0-9._-], a letter or digit first, after "
              "the key)");
  }
  EXPECT_EQ(parsing(key + " a b\n"), "keys line = 1 (must be KEY NAME)");
  EXPECT_EQ(parsing(fine + key + " b\n"), "keys line = 2 (names a key a second time)");
}

TEST(AllowListText, NamesTheRightsOfClients) {
  const std::string one = new_key();
  const std::string two = new_key();
  const AllowedKeys keys = parse_allow_list(one + " anna\n" + two + " ben observe,control \n",
                                            wire::KeyRole::client, "keys");
  EXPECT_EQ(keys.at(one).rights, usual_rights);
  EXPECT_EQ(keys.at(two).rights, parse_rights("control,observe"));
  for (const std::string rights : {"all", "observe,", ",submit", "observe submit", "Submit"}) {
    EXPECT_NE(parsing_clients(one + " anna " + rights + "\n"), "") << rights;
  }
  EXPECT_EQ(parsing_clients(one + " anna everything\n"),
            "keys line = 1 (must have rights of observe,submit,control after the name)");
  EXPECT_EQ(parsing_clients(one + " anna submit extra\n"),
            "keys line = 1 (must be KEY NAME RIGHTS)");
}

TEST(AllowListText, HasALimit) {
  std::string text;
  // Any 32 bytes are a public key; digits make distinct ones without 65537 key generations.
  const auto line = [](std::size_t i) {
    std::string number = std::to_string(i);
    return std::string(40 - number.size(), '0') + number + " a\n";
  };
  for (std::size_t i = 0; i < allowed_keys_max; ++i) text += line(i);
  EXPECT_EQ(parse_allow_list(text, wire::KeyRole::worker, "keys").size(), allowed_keys_max);
  EXPECT_EQ(parsing(text + line(allowed_keys_max)), "keys line = 65537 (is one key too many)");
}

class AllowListFile : public ::testing::Test {
 protected:
  void write(const std::string& text) {
    wire::write_whole_file("list", file_, text, 0644, wire::IfThere::replace);
  }

  /// A look a second after the one before.
  /// @return What it finds wrong.
  std::optional<std::string> look(AllowList& list) {
    events_.clear();
    list.refresh(now_ += milliseconds(1000));
    if (events_.empty() || events_[0].kind != "allow_list_unreadable") return std::nullopt;
    const std::string text = to_text(events_[0].fields);
    return text.substr(0, text.find("; the list before it stands"));
  }

  std::vector<Event> events_;
  Log log_ = [this](const Event& event) { events_.push_back(event); };

  AllowList::TimePoint now_{};
  ScratchDirectory directory_;
  std::filesystem::path file_ = directory_ / "authorized_workers";
  std::string one_ = new_key();
  std::string two_ = new_key();
};

TEST_F(AllowListFile, ChangesAreSeen) {
  write(one_ + " a\n");
  AllowList list(file_, wire::KeyRole::worker, log_);
  write(two_ + " a\n");
  EXPECT_FALSE(look(list));
  EXPECT_NE(list.owner_of(one_), nullptr) << "one look revokes nothing";
  EXPECT_NE(list.owner_of(two_), nullptr) << "a new key counts at once";
  list.refresh(now_ + milliseconds(999));
  EXPECT_NE(list.owner_of(one_), nullptr) << "nor does one that follows at once";
  EXPECT_FALSE(look(list));
  EXPECT_EQ(list.owner_of(one_), nullptr);
  EXPECT_NE(list.owner_of(two_), nullptr);
}

TEST_F(AllowListFile, OfWhichTwoLooksDifferRevokesWhatBothLack) {
  write(one_ + " a\n" + two_ + " b\n");
  AllowList list(file_, wire::KeyRole::worker, log_);
  write("# nobody\n");
  EXPECT_FALSE(look(list));
  write(two_ + " b\n");
  EXPECT_FALSE(look(list));
  EXPECT_FALSE(look(list));
  EXPECT_EQ(list.owner_of(one_), nullptr);
  EXPECT_NE(list.owner_of(two_), nullptr);
}

// An editor that writes in place, twice within one tick of the file system's clock.
TEST_F(AllowListFile, ChangesOfTheSameSizeInPlaceAreSeen) {
  for (int i = 0; i < 50; ++i) {
    write_text(file_, one_ + " a\n", 0644);
    AllowList list(file_, wire::KeyRole::worker, log_);
    write_text(file_, two_ + " a\n", 0644);
    EXPECT_FALSE(look(list));
    EXPECT_FALSE(look(list));
    EXPECT_EQ(list.owner_of(one_), nullptr);
  }
}

TEST_F(AllowListFile, ThatIsWrongOrGoneLeavesTheListStanding) {
  write(one_ + " a\n");
  AllowList list(file_, wire::KeyRole::worker, log_);

  write("nonsense\n");
  EXPECT_EQ(look(list).value_or(""),
            file_.string() + " line = 1 (must begin with a public key of 40 characters)");
  EXPECT_FALSE(look(list));  // Once.
  EXPECT_NE(list.owner_of(one_), nullptr);

  std::filesystem::remove(file_);
  EXPECT_EQ(look(list).value_or(""),
            "allow-list = " + file_.string() + " (No such file or directory)");
  EXPECT_FALSE(look(list));
  EXPECT_NE(list.owner_of(one_), nullptr);

  write(two_ + " a\n");
  EXPECT_FALSE(look(list));
  EXPECT_FALSE(look(list));
  EXPECT_EQ(list.owner_of(one_), nullptr);

  write("nonsense\n");
  EXPECT_TRUE(look(list));  // Again, as it was right in between.
}

TEST_F(AllowListFile, TellsOfChangesAndThatItCanBeReadAgain) {
  write(one_ + " a\n");
  AllowList list(file_, wire::KeyRole::worker, log_);
  const auto change = [&] {
    (void)look(list);
    if (events_.empty() || events_[0].kind != "allow_list_read") return std::string("none");
    return to_text(std::span(events_[0].fields).subspan(1));
  };
  EXPECT_EQ(change(), "none");
  write(two_ + " a\n");
  EXPECT_EQ(change(), "added=1 removed=0");
  EXPECT_EQ(change(), "added=0 removed=1");
  write("wrong\n");
  EXPECT_EQ(change(), "none");
  write(two_ + " a\n");
  EXPECT_EQ(change(), "added=0 removed=0");
  EXPECT_EQ(change(), "none");
}

TEST_F(AllowListFile, IsLookedAtOnceASecond) {
  write(one_ + " a\n");
  AllowList list(file_, wire::KeyRole::worker, log_);
  AllowList::TimePoint now{};
  list.refresh_if_due(now);
  write(two_ + " a\n");
  list.refresh_if_due(now + milliseconds(999));
  EXPECT_EQ(list.owner_of(two_), nullptr);
  list.refresh_if_due(now + milliseconds(1000));
  EXPECT_NE(list.owner_of(two_), nullptr);
}

TEST_F(AllowListFile, ThatCannotBeTrustedIsRefused) {
  const auto opening = [&](const std::filesystem::path& file) {
    return refusal_of([&] { const AllowList list(file, wire::KeyRole::worker, log_); });
  };
  EXPECT_EQ(opening(file_), "allow-list = " + file_.string() + " (No such file or directory)");
  EXPECT_EQ(opening(directory_.path()),
            "allow-list = " + directory_.path().string() + " (must be a regular file)");
  write(one_ + " a\n");
  for (const auto& [mode, text] : {std::pair{0664, "0664"}, {0646, "0646"}}) {
    ::chmod(file_.c_str(), static_cast<mode_t>(mode));
    EXPECT_EQ(opening(file_), "allow-list = " + file_.string() + " (mode " + text +
                                  "; must be writable by its owner alone: chmod go-w)");
  }
  ::chmod(file_.c_str(), 0644);
  std::filesystem::resize_file(file_, (std::uintmax_t{16} << 20) + 1);
  EXPECT_EQ(opening(file_), "allow-list = " + file_.string() + " (is too large)");
}

class RefusalLogTest : public ::testing::Test {
 protected:
  void refuse(const std::string& key, std::chrono::seconds at, const std::string& address = "") {
    log_.refused({.domain = "workers", .address = address, .public_key = key}, "unknown key",
                 RefusalLog::TimePoint{} + at);
  }

  std::vector<Event> events_;
  RefusalLog log_{[this](Event event) { events_.push_back(std::move(event)); }};
};

using std::chrono::seconds;

TEST_F(RefusalLogTest, WritesAddressesPlainly) {
  refuse("KEY", seconds(0), "::ffff:10.0.0.7");
  refuse("KEY", seconds(0), "::ffff:1");
  refuse("", seconds(0));
  ASSERT_EQ(events_.size(), 3u);
  EXPECT_EQ(events_[0].kind, "peer_refused");
  EXPECT_EQ(events_[0].severity, Severity::warning);
  EXPECT_EQ(to_text(events_[0].fields),
            "domain=workers address=10.0.0.7 key=KEY reason=\"unknown key\"");
  EXPECT_EQ(to_text(events_[1].fields),
            "domain=workers address=::ffff:1 key=KEY reason=\"unknown key\"");
  EXPECT_EQ(to_text(events_[2].fields),
            "domain=workers address=unknown key=none reason=\"unknown key\"");
}

TEST_F(RefusalLogTest, SaysTheSameOnceAMinute) {
  refuse("KEY", seconds(1));
  refuse("KEY", seconds(60));
  EXPECT_EQ(events_.size(), 1u);
  refuse("KEY", seconds(61));
  EXPECT_EQ(events_.size(), 2u);
}

TEST_F(RefusalLogTest, CountsAFlood) {
  for (int i = 0; i < 1000; ++i) refuse("KEY" + std::to_string(i), seconds(1));
  EXPECT_EQ(events_.size(), 20u);
  refuse("KEY", seconds(100));
  ASSERT_EQ(events_.size(), 22u);
  EXPECT_EQ(events_[20].kind, "peers_refused");
  EXPECT_EQ(to_text(events_[20].fields), "count=980 without a line each");
}

TEST(RightsOfAKey, AreAListOfWords) {
  EXPECT_EQ(parse_rights("observe,submit,control"), all_rights);
  EXPECT_EQ(parse_rights("submit,observe"), usual_rights);
  EXPECT_FALSE(parse_rights("observe")->contains(Right::submit));
  for (const std::string text : {"", "observe,", ",", "Observe", "observe, submit", "root"}) {
    EXPECT_EQ(parse_rights(text), std::nullopt) << text;
  }
}

}  // namespace
}  // namespace proofmass::coordinator
