#include "proto/link/keys.hpp"

#include <sys/types.h>
#include <unistd.h>
#include <zmq.h>

#include <cstring>
#include <type_traits>

#include "core/error.hpp"
#include "proto/link/whole_file.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/test.hpp"

namespace proofmass::wire {
namespace {

using test::mode_of;
using test::refusal_of;
using test::ScratchDirectory;
using test::text_of;
using test::write_text;

std::string reading(const std::filesystem::path& file, KeyRole role) {
  return refusal_of([&] { (void)read_key_pair(file, role); });
}

std::string reading_public(const std::filesystem::path& file, KeyRole role) {
  return refusal_of([&] { (void)read_public_key(file, role); });
}

std::string message(const std::filesystem::path& file, const std::string& rule) {
  return "key file = " + file.string() + " (" + rule + ")";
}

// ZeroMQ derives the public half from the secret one: an independent truth.
TEST(KeyFiles, HoldKeysOfCurve25519) {
  const KeyPair pair = make_key_pair();
  std::array<char, 41> derived{};
  ASSERT_EQ(zmq_curve_public(derived.data(), pair.secret_key.reveal().c_str()), 0);
  EXPECT_EQ(pair.public_key.text(), derived.data());
  EXPECT_NE(make_key_pair().public_key, pair.public_key);
}

TEST(KeyFiles, SecretOnesAreTheOwnersAloneWhateverTheUmask) {
  for (const mode_t mask : {mode_t{0}, mode_t{0022}, mode_t{0077}}) {
    const ScratchDirectory directory;
    const mode_t before = ::umask(mask);
    write_key_pair(directory.path(), "client", KeyRole::client, make_key_pair());
    ::umask(before);
    EXPECT_EQ(mode_of(directory / "client.key"), 0600u);
    EXPECT_EQ(mode_of(directory / "client.pub"), 0644u & ~mask);
  }
}

TEST(KeyFiles, PublicOneDoesNotHoldTheSecret) {
  const ScratchDirectory directory;
  const KeyPair pair = make_key_pair();
  write_key_pair(directory.path(), "client", KeyRole::client, pair);
  EXPECT_NE(text_of(directory / "client.key").find(pair.secret_key.reveal()), std::string::npos);
  EXPECT_EQ(text_of(directory / "client.pub").find(pair.secret_key.reveal()), std::string::npos);
}

TEST(KeyFiles, OfSomebodyElseAreRefused) {
  if (::geteuid() != 0) return test::skip_for_want("only root can give a file away");
  const ScratchDirectory directory;
  write_key_pair(directory.path(), "worker", KeyRole::worker, make_key_pair());
  const auto file = directory / "worker.key";
  ASSERT_EQ(::chown(file.c_str(), 1234, 1234), 0);
  EXPECT_EQ(reading(file, KeyRole::worker),
            message(file, "owner = user 1234; must be owned by user 0, who runs this program"));
}

TEST(KeyFiles, OfAnotherRoleOrHalfAreNamed) {
  const ScratchDirectory directory;
  write_key_pair(directory.path(), "worker", KeyRole::worker, make_key_pair());
  const auto key = directory / "worker.key";
  const auto pub = directory / "worker.pub";
  EXPECT_EQ(reading(key, KeyRole::client),
            message(key, "is the secret key of a worker; must be the secret key of a client"));
  EXPECT_EQ(reading_public(pub, KeyRole::coordinator),
            message(pub, "is the public key of a worker; must be the public key of a coordinator"));
  EXPECT_EQ(reading_public(key, KeyRole::worker),
            message(key, "is the secret key of a worker; must be the public key of a worker"));
  ::chmod(pub.c_str(), 0600);
  EXPECT_EQ(reading(pub, KeyRole::worker),
            message(pub, "is the public key of a worker; must be the secret key of a worker"));
}

TEST(KeyFiles, ThatAreNoneAreRefused) {
  const ScratchDirectory directory;
  const auto file = directory / "x.key";
  EXPECT_EQ(reading(file, KeyRole::worker), message(file, "No such file or directory"));
  EXPECT_EQ(reading(directory.path(), KeyRole::worker),
            message(directory.path(), "must be a regular file"));
  for (const std::string text : {"", "\n", "-----BEGIN PRIVATE KEY-----\n", "proofmass-keys 1"}) {
    write_text(file, text, 0600);
    EXPECT_EQ(reading(file, KeyRole::worker), message(file, "is not a key file of Proofmass"));
  }
  write_text(file, "proofmass-key 2 worker secret\n", 0600);
  EXPECT_EQ(
      reading(file, KeyRole::worker),
      message(file, "is of an unknown kind; must begin with `proofmass-key 1 worker secret`"));
}

TEST(KeyFiles, ThatAreDamagedAreRefused) {
  const ScratchDirectory directory;
  const KeyPair pair = make_key_pair();
  const std::string head = "proofmass-key 1 worker secret\n";
  const std::string public_line = "public " + pair.public_key.text() + "\n";
  const std::string secret_line = "secret " + pair.secret_key.reveal() + "\n";
  const auto file = directory / "worker.key";
  const auto refusal = [&](const std::string& text) {
    write_text(file, text, 0600);
    return reading(file, KeyRole::worker);
  };

  EXPECT_EQ(refusal(head + public_line + secret_line), "accepted");
  for (const std::string& text :
       {head, head + public_line, head + secret_line + public_line,
        head + public_line + secret_line + "\n", head + public_line + "secret \n",
        head + public_line + "secret " + std::string(40, '~') + "\n",
        head + public_line + secret_line.substr(0, 30) + "\n"}) {
    EXPECT_EQ(refusal(text), message(file, "is damaged"));
  }
  EXPECT_EQ(refusal(head + "public " + make_key_pair().public_key.text() + "\n" + secret_line),
            message(file, "is damaged: its halves do not belong together"));

  write_text(directory / "x.pub", "proofmass-key 1 worker public\npublic nothing\n", 0644);
  EXPECT_EQ(reading_public(directory / "x.pub", KeyRole::worker),
            message(directory / "x.pub", "is damaged"));
}

// Whatever is wrong with a file, what it says may be a secret.
TEST(KeyFiles, SecretsAreInNoMessage) {
  const ScratchDirectory directory;
  const std::string secret = make_key_pair().secret_key.reveal();
  const auto file = directory / "worker.key";
  for (const std::string& text :
       {secret, secret + " " + secret, "proofmass-key " + secret, "proofmass-key 1 " + secret,
        "proofmass-key 1 worker secret\n" + secret + "\n" + secret + "\n",
        "proofmass-key 1 worker secret\npublic " + make_key_pair().public_key.text() + "\nsecret " +
            secret + "\n"}) {
    write_text(file, text, 0600);
    const std::string refusal = reading(file, KeyRole::worker);
    EXPECT_NE(refusal, "accepted");
    EXPECT_EQ(refusal.find(secret.substr(0, 8)), std::string::npos) << refusal;
  }
}

// A secret can be formatted by nothing but its reveal().
static_assert(!std::is_convertible_v<SecretKey, std::string>);
static_assert(!std::is_convertible_v<SecretKey, std::string_view>);

// The first five characters are 32 bits in base 85, and 84·85⁴ > 2³², `#` being the digit 84.
TEST(PublicKeys, Are40CharactersOfZ85AndNoComment) {
  const std::string good = make_key_pair().public_key.text();
  EXPECT_TRUE(PublicKey::parse(good));
  EXPECT_FALSE(PublicKey::parse(good.substr(1)));
  EXPECT_FALSE(PublicKey::parse(good + "0"));
  EXPECT_FALSE(PublicKey::parse(""));
  std::string other = good;
  other[0] = '~';  // None of the 85.
  EXPECT_FALSE(PublicKey::parse(other));
  EXPECT_FALSE(PublicKey::parse(std::string(40, '\0')));
  std::string digits(40, '0');
  EXPECT_TRUE(PublicKey::parse(digits));
  digits[0] = '#';
  EXPECT_FALSE(PublicKey::parse(digits));
  EXPECT_FALSE(SecretKey::parse(good.substr(1)));
}

TEST(WholeFile, ReplacesOnlyWhenAsked) {
  const ScratchDirectory directory;
  const auto file = directory / "list";
  write_whole_file("list", file, "one", 0644, IfThere::keep);
  EXPECT_EQ(refusal_of([&] { write_whole_file("list", file, "two", 0644, IfThere::keep); }),
            "list = " + file.string() + " (cannot be written: File exists)");
  EXPECT_EQ(text_of(file), "one");
  write_whole_file("list", file, "two", 0640, IfThere::replace);
  EXPECT_EQ(text_of(file), "two");
  EXPECT_EQ(mode_of(file), 0644u);  // That of the one before.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory.path()),
                          std::filesystem::directory_iterator()),
            1);
}

}  // namespace
}  // namespace proofmass::wire
