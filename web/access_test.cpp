#include "web/access.h"

#include <gtest/gtest.h>

#include "lapservo/core/error.h"

namespace lapservo::internal::access_test {

HttpRequest request(const std::string& method, const std::string& path,
                    std::multimap<std::string, std::string> headers) {
  return {method, path, std::move(headers), {}};
}

int status(const Access& access, const HttpRequest& asked) {
  const auto refusal = access.refuse(asked);
  return refusal ? refusal->status : 200;
}

TEST(Access, TakesThisComputersNamesOnly) {
  const Access access(true, "");
  for (const char* host : {"localhost", "LOCALHOST:8080", "127.0.0.1:8080", "127.8.0.1", "[::1]:9000", "[::1]"})
    EXPECT_EQ(status(access, request("GET", "/", {{"host", host}})), 200) << host;
  for (const char* host : {"", "evil.example", "evil.example:8080", "localhost.evil.example", "192.168.1.2:8080",
                           "localhost:", "localhost:x", "localhost:123456", "[::1", "::1", "[::1]x", "a@localhost",
                           "localhost:80:80", "127.0.0.1.", "[fe80::1]:80"})
    EXPECT_EQ(status(access, request("GET", "/", {{"host", host}})), 403) << host;
  EXPECT_EQ(status(access, request("GET", "/", {})), 403);
  EXPECT_EQ(status(access, request("GET", "/", {{"host", "localhost"}, {"host", "localhost"}})), 403);
}

TEST(Access, RefusesPagesOfOtherSites) {
  const Access access(true, "");
  const std::string host = "127.0.0.1:8080";
  EXPECT_EQ(status(access, request("POST", "/hold", {{"host", host}, {"origin", "http://" + host}})), 200);
  for (const char* origin : {"http://evil.example", "null", "https://127.0.0.1:8080", "http://127.0.0.1:8081",
                             "http://localhost:8080", "", "http://127.0.0.1:8080.evil.example"})
    for (const char* method : {"GET", "POST"})
      EXPECT_EQ(status(access, request(method, "/hold", {{"host", host}, {"origin", origin}})), 403) << origin;
  EXPECT_EQ(status(access, request("POST", "/hold", {{"host", host}})), 403);
  EXPECT_EQ(status(access, request("GET", "/picture", {{"host", host}, {"sec-fetch-site", "cross-site"}})), 403);
  EXPECT_EQ(status(access, request("GET", "/picture", {{"host", host}, {"sec-fetch-site", "same-origin"}})), 200);
}

TEST(Access, AsksStrangersForTheToken) {
  const std::string token = random_token();
  EXPECT_EQ(token.size(), 64u);
  EXPECT_NE(token, random_token());
  const Access access(false, token);
  HttpRequest asked = request("GET", "/state", {{"host", "192.168.1.2:8080"}});
  EXPECT_EQ(status(access, asked), 401);
  for (const std::string& wrong : {std::string("x"), token.substr(1), token + "0", "0" + token.substr(1) + "0"}) {
    asked.cookies = {{"lapservo_token_8080", wrong}};
    EXPECT_EQ(status(access, asked), 401);
  }
  asked.cookies = {{"lapservo_token_8080", token}};
  EXPECT_EQ(status(access, asked), 200);

  HttpRequest first = request("GET", "/", {{"host", "192.168.1.2:8080"}});
  EXPECT_EQ(status(access, first), 401);
  first.query = {{"token", "wrong"}};
  EXPECT_EQ(status(access, first), 401);
  first.query = {{"token", token}};
  const auto welcome = access.refuse(first);
  ASSERT_TRUE(welcome);
  EXPECT_EQ(welcome->status, 200);
  EXPECT_EQ(welcome->headers.back().second, "lapservo_token_8080=" + token + "; HttpOnly; SameSite=Strict; Path=/");
  // A name may be rebound, whoever has the token.
  first.headers = {{"host", "evil.example:8080"}};
  EXPECT_EQ(status(access, first), 403);
}

// The address that lapservo prints, followed from a notebook, a terminal in a browser, a wiki.
TEST(Access, LetsALinkToThePageThrough) {
  const Access access(true, "");
  const auto followed = [](const std::string& method, const std::string& path, const std::string& mode) {
    return request(method, path, {{"host", "localhost"}, {"sec-fetch-site", "cross-site"}, {"sec-fetch-mode", mode}});
  };
  EXPECT_EQ(status(access, followed("GET", "/", "navigate")), 200);
  EXPECT_EQ(status(access, followed("GET", "/", "no-cors")), 403);
  EXPECT_EQ(status(access, followed("GET", "/state", "navigate")), 403);
  EXPECT_EQ(status(access, followed("POST", "/", "navigate")), 403);
}

TEST(Access, KnowsWhatIsThisComputer) {
  for (const char* own : {"127.0.0.1", "::1"}) EXPECT_TRUE(is_loopback(own, "--listen")) << own;
  for (const char* all : {"0.0.0.0", "::", "::ffff:127.0.0.1"}) EXPECT_FALSE(is_loopback(all, "--listen")) << all;
  for (const char* none : {"", "localhost", "1.2.3", "1.2.3.4:80"})
    EXPECT_THROW(is_loopback(none, "--listen"), InputError) << none;
}

}  // namespace lapservo::internal::access_test
