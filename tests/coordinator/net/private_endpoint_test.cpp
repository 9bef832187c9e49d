#include "coordinator/net/private_endpoint.hpp"

#include <gtest/gtest.h>

#include "proto/wire/endpoint.hpp"

namespace proofmass::coordinator {
namespace {

TEST(PrivateEndpoint, LiesInADirectoryThatOnlyThisUserCanEnter) {
  const PrivateEndpoint endpoint;
  EXPECT_NO_THROW(wire::check_endpoint("bind", endpoint.address()));
  const std::filesystem::path socket = endpoint.address().substr(6);
  const auto permissions = std::filesystem::status(socket.parent_path()).permissions();
  EXPECT_EQ(permissions, std::filesystem::perms::owner_all);
}

TEST(PrivateEndpoint, LeavesNothingBehind) {
  std::filesystem::path directory;
  {
    const PrivateEndpoint endpoint;
    directory = std::filesystem::path(endpoint.address().substr(6)).parent_path();
    EXPECT_TRUE(std::filesystem::exists(directory));
  }
  EXPECT_FALSE(std::filesystem::exists(directory));
}

TEST(PrivateEndpoint, IsAnotherEachTime) {
  EXPECT_NE(PrivateEndpoint().address(), PrivateEndpoint().address());
}

}  // namespace
}  // namespace proofmass::coordinator
