#include "common/config/share.hpp"

#include <fmt/format.h>
#include <sys/auxv.h>

#include <algorithm>
#include <string>
#include <system_error>
#include <vector>

#include "common/config/key_hint.hpp"
#include "common/config/user_error.hpp"

namespace trocar::config {
namespace {

std::vector<std::string> names_in(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (std::filesystem::directory_iterator it(folder, ignored), end; !ignored && it != end; it.increment(ignored)) {
    if (it->path().extension() == ".toml") names.push_back(it->path().stem().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace

std::filesystem::path share_folder() {
  std::error_code error;
  std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) {  // a bare root without /proc: the path that started this program, which the kernel leaves in its memory
    const auto* started_as = reinterpret_cast<const char*>(::getauxval(AT_EXECFN));  // NOLINT(performance-no-int-to-ptr): the kernel's way
    if (started_as != nullptr) program = std::filesystem::canonical(started_as, error);
  }
  if (program.empty()) throw UserError("cannot find the folder of the running program; give paths instead of names");
  return program.parent_path().parent_path() / "share" / "trocar";
}

std::filesystem::path find_share(std::string_view kind, std::string_view name_or_path) {
  if (name_or_path.find('/') != std::string_view::npos || name_or_path.ends_with(".toml")) return name_or_path;
  const std::filesystem::path folder = share_folder() / kind;
  std::filesystem::path file = folder / fmt::format("{}.toml", name_or_path);
  std::error_code error;
  if (!name_or_path.empty() && std::filesystem::exists(file, error)) return file;

  const std::vector<std::string> names = names_in(folder);
  const std::vector<std::string_view> views(names.begin(), names.end());
  const std::string_view like = nearest(name_or_path, views);
  throw UserError(fmt::format("{}: nothing of this name in {}; {}write {}a path such as ./{}.toml", name_or_path, folder.string(),
                              like.empty() ? std::string() : fmt::format("did you mean {}? ", like),
                              names.empty() ? std::string() : fmt::format("one of {}, or ", fmt::join(names, ", ")),
                              name_or_path.empty() ? "my" : name_or_path));
}

}  // namespace trocar::config
