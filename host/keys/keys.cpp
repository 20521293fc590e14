#include "host/keys/keys.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <fstream>
#include <string_view>

#include "common/config/user_error.hpp"
#include "common/wire/topics.hpp"
#include "host/tool/run.hpp"

namespace trocar::keys {

namespace fs = std::filesystem;

namespace {

constexpr int valid_days = 3650;
constexpr std::array<const char*, 3> roles{"rig", "host", "observer"};

constexpr const char* governance = R"(<?xml version="1.0" encoding="UTF-8"?>
<dds><domain_access_rules><domain_rule>
  <domains><id_range><min>0</min><max>230</max></id_range></domains>
  <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
  <enable_join_access_control>true</enable_join_access_control>
  <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
  <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
  <rtps_protection_kind>SIGN</rtps_protection_kind>
  <topic_access_rules><topic_rule>
    <topic_expression>*</topic_expression>
    <enable_discovery_protection>true</enable_discovery_protection>
    <enable_liveliness_protection>true</enable_liveliness_protection>
    <enable_read_access_control>true</enable_read_access_control>
    <enable_write_access_control>true</enable_write_access_control>
    <metadata_protection_kind>ENCRYPT</metadata_protection_kind>
    <data_protection_kind>NONE</data_protection_kind>
  </topic_rule></topic_access_rules>
</domain_rule></domain_access_rules></dds>
)";

// @KEYS@ and @PLUGINS@ are filled in by who reads it: the folder may be copied to another machine.
constexpr const char* network = R"(<General>
  <Interfaces><NetworkInterface name="{0}"/></Interfaces>
  <AllowMulticast>false</AllowMulticast>
  <MaxMessageSize>65500B</MaxMessageSize>
</General>
<Discovery>
  <ParticipantIndex>auto</ParticipantIndex>
  <MaxAutoParticipantIndex>31</MaxAutoParticipantIndex>
  <Peers>{1}</Peers>
</Discovery>
<Internal><SocketReceiveBufferSize min="default" max="16MB"/></Internal>
<Security>
  <Authentication>
    <Library path="@PLUGINS@/libdds_security_auth.so" initFunction="init_authentication" finalizeFunction="finalize_authentication"/>
    <IdentityCertificate>file:@KEYS@/identity.pem</IdentityCertificate>
    <IdentityCA>file:@KEYS@/ca.pem</IdentityCA>
    <PrivateKey>file:@KEYS@/key.pem</PrivateKey>
  </Authentication>
  <AccessControl>
    <Library path="@PLUGINS@/libdds_security_ac.so" initFunction="init_access_control" finalizeFunction="finalize_access_control"/>
    <PermissionsCA>file:@KEYS@/ca.pem</PermissionsCA>
    <Governance>file:@KEYS@/governance.p7s</Governance>
    <Permissions>file:@KEYS@/permissions.p7s</Permissions>
  </AccessControl>
  <Cryptographic>
    <Library path="@PLUGINS@/libdds_security_crypto.so" initFunction="init_crypto" finalizeFunction="finalize_crypto"/>
  </Cryptographic>
</Security>
)";

template <class Which>
std::string topics(Which which) {
  std::string list;
  for (const wire::Topic& topic : wire::topics)
    if (which(topic)) list += fmt::format("<topic>{}</topic>", topic.name);
  return list;
}

std::string date_after(int days) {
  const std::time_t t = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now() + std::chrono::hours(24) * days);
  std::tm utc{};
  gmtime_r(&t, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S", &utc);
  return text.data();
}

std::string permissions(const std::string& role) {
  const bool rig = role == "rig", observer = role == "observer";
  const std::string writes = topics([&](const wire::Topic& topic) { return !observer && topic.from_host != rig; });
  const std::string reads = topics([&](const wire::Topic& topic) { return !rig || topic == wire::command_topic; });
  return fmt::format(R"(<?xml version="1.0" encoding="UTF-8"?>
<dds><permissions><grant name="{0}">
  <subject_name>CN=trocar {0}</subject_name>
  <validity><not_before>{1}</not_before><not_after>{2}</not_after></validity>
  <allow_rule>
    <domains><id_range><min>0</min><max>230</max></id_range></domains>
    {3}
    <subscribe><topics>{4}</topics></subscribe>
  </allow_rule>
  <default>DENY</default>
</grant></permissions></dds>
)",
                     role, date_after(-1), date_after(valid_days),
                     writes.empty() ? "" : fmt::format("<publish><topics>{}</topics></publish>", writes), reads);
}

// Made beside its place, then renamed; what was not finished is removed.
class NewFolder {
 public:
  explicit NewFolder(fs::path folder) : folder_(std::move(folder)), part_(folder_.string() + ".part") {
    if (folder_.empty() || fs::exists(folder_))
      throw config::UserError(fmt::format("{}: exists already; keys are never replaced: choose a new folder", folder_.string()));
    std::error_code error;
    fs::remove_all(part_, error);
    fs::create_directories(part_, error);
    if (!error) fs::permissions(part_, fs::perms::owner_all, error);
    if (error)
      throw config::UserError(
          fmt::format("{}: cannot be made ({}); choose a folder that you may write to", part_.string(), error.message()));
  }
  ~NewFolder() {
    std::error_code ignored;
    if (!part_.empty()) fs::remove_all(part_, ignored);
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return part_; }
  void keep() {
    fs::rename(part_, folder_);
    part_.clear();
  }

 private:
  fs::path folder_, part_;
};

void put(const fs::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  if (!out.flush()) throw config::UserError(file.string() + ": cannot be written; free some space");
}

void openssl(const fs::path& folder, std::vector<std::string> words) {
  words.insert(words.begin(), "openssl");
  const tool::Outcome outcome = tool::run(words, folder / "messages.txt");
  fs::remove(folder / "messages.txt");
  if (outcome.error_number == ENOENT)
    throw config::UserError("keys need openssl, which is not installed: apt-get install --no-install-recommends openssl");
  if (outcome.error_number != 0) throw config::UserError(fmt::format("openssl cannot be started: {}", std::strerror(outcome.error_number)));
  if (!outcome.good) throw config::UserError(fmt::format("openssl {} failed: {}", words[1], outcome.messages));
}

void refuse_strange(const std::string& name, std::string_view what, std::string_view remedy) {
  const auto plain = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || std::string_view(".:-_%").find(c) != std::string_view::npos;
  };
  if (name.empty() || !std::ranges::all_of(name, plain))
    throw config::UserError(fmt::format("{} \"{}\": no {}; {}", what, name, what, remedy));
}

}  // namespace

void make(const Options& options) {
  refuse_strange(options.interface, "interface", "`ip link` lists them, such as eth1");
  std::string peers;
  for (const std::string& peer : options.peers) {
    refuse_strange(peer, "peer", "give the address of the other machine, such as 192.168.7.2");
    peers += fmt::format("<Peer address=\"{}\"/>", peer);
  }
  NewFolder folder(options.folder);
  const auto in = [&](const fs::path& name) { return (folder.path() / name).string(); };
  const auto run = [&](std::vector<std::string> words) { openssl(folder.path(), std::move(words)); };
  const std::string days = std::to_string(valid_days);
  const auto make_key = [&](const fs::path& name) {
    run({"ecparam", "-name", "prime256v1", "-genkey", "-noout", "-out", in(name)});
    fs::permissions(in(name), fs::perms::owner_read | fs::perms::owner_write);
  };
  make_key("ca_key.pem");
  run({"req", "-x509", "-new", "-key", in("ca_key.pem"), "-out", in("ca.pem"), "-days", days, "-subj", "/CN=trocar authority"});
  const auto sign = [&](const fs::path& text, const fs::path& out) {
    run({"smime", "-sign", "-text", "-in", in(text), "-out", in(out), "-signer", in("ca.pem"), "-inkey", in("ca_key.pem")});
    fs::remove(in(text));
  };
  for (const std::string role : roles) {
    const fs::path own = role;
    fs::create_directory(folder.path() / own);
    make_key(own / "key.pem");
    run({"req", "-new", "-key", in(own / "key.pem"), "-out", in(own / "request.pem"), "-subj", "/CN=trocar " + role});
    run({"x509", "-req", "-in", in(own / "request.pem"), "-CA", in("ca.pem"), "-CAkey", in("ca_key.pem"), "-CAcreateserial", "-days", days,
         "-out", in(own / "identity.pem")});
    fs::remove(in(own / "request.pem"));
    fs::copy_file(in("ca.pem"), in(own / "ca.pem"));
    put(in(own / "governance.xml"), governance);
    sign(own / "governance.xml", own / "governance.p7s");
    put(in(own / "permissions.xml"), permissions(role));
    sign(own / "permissions.xml", own / "permissions.p7s");
    put(in(own / "network.xml"), fmt::format(fmt::runtime(network), options.interface, peers));
  }
  folder.keep();
}

}  // namespace trocar::keys
