#include "host/cli/scene_commands.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <optional>
#include <utility>

#include "common/condense/compile.hpp"
#include "common/config/new_file.hpp"
#include "common/config/share.hpp"
#include "common/config/user_error.hpp"
#include "common/core/capacities.hpp"
#include "common/image_file/mapped_image.hpp"
#include "common/scene/scene.hpp"
#include "host/cli/tick_cost.hpp"

namespace trocar::cli {
namespace {

double mb(std::size_t bytes) { return 1e-6 * static_cast<double>(bytes); }

std::string json_text(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

// One live line on a terminal; one line a phase elsewhere.
class Bar {
 public:
  void show(std::string_view phase, double fraction) {
    if (!terminal_) {
      if (phase != phase_) fmt::print(stderr, "{}\n", phase);
    } else {
      constexpr int width = 30;
      const auto filled = static_cast<std::size_t>(std::lround(width * fraction));
      fmt::print(stderr, "\r[{}{}] {:3.0f} %  {}\033[K", std::string(filled, '#'), std::string(width - filled, '.'), 100.0 * fraction,
                 phase);
      std::fflush(stderr);
    }
    phase_ = phase;
  }
  void end() {
    if (terminal_ && !phase_.empty()) fmt::print(stderr, "\r\033[K");
  }

 private:
  bool terminal_ = isatty(STDERR_FILENO) == 1;
  std::string phase_;
};

void print_plan(std::FILE* to, const scene::Scene& scene, const condense::Plan& plan) {
  const condense::Cost& cost = plan.cost;
  fmt::print(to, "{}: {} nodes, {} elements, {} unknowns\n", scene.file.string(), plan.mesh.node.size(), plan.mesh.element.size(),
             cost.unknowns);
  fmt::print(to, "  candidates    {} nodes, {} columns; edges {:.3g} mm, contacts every {:.3g} mm, at most {} of {}\n", cost.columns / 2,
             cost.columns, 1e3 * plan.candidates.edge_length_m, 1e3 * plan.law.spacing_m, plan.need.contacts, capacity::contacts);
  fmt::print(to, "  image         {:.1f} MB in {}\n", mb(cost.image_bytes), plan.single_precision ? "float32" : "float64");
  if (cost.visible_bytes > 0) fmt::print(to, "  visible map   {:.1f} MB for {} nodes\n", mb(cost.visible_bytes), plan.visible.node.size());
  fmt::print(to, "  memory        about {:.0f} MB to compile\n", mb(cost.memory_bytes));
}

std::string plan_json(const condense::Plan& plan) {
  const condense::Cost& cost = plan.cost;
  return fmt::format(
      "\"nodes\": {}, \"elements\": {}, \"unknowns\": {}, \"candidates\": {}, \"columns\": {}, \"edge_m\": {}, \"spacing_m\": {}, "
      "\"image_bytes\": {}, \"visible_bytes\": {}, \"memory_bytes\": {}",
      plan.mesh.node.size(), plan.mesh.element.size(), cost.unknowns, cost.columns / 2, cost.columns, plan.candidates.edge_length_m,
      plan.law.spacing_m, cost.image_bytes, cost.visible_bytes, cost.memory_bytes);
}

condense::Options compile_options(const std::atomic<bool>& stop, Bar& bar) {
  condense::Options options;
  options.progress = [&stop, &bar](std::string_view phase, double fraction) {
    if (stop.load()) {
      bar.end();
      throw config::UserError("stopped; nothing was written");
    }
    bar.show(phase, fraction);
  };
  return options;
}

void write(config::NewFile& file, std::span<const std::byte> bytes) {
  file.stream().write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

const char* name_of(element::Model model) {
  return model == element::Model::PlaneStress ? "plane_stress" : model == element::Model::PlaneStrain ? "plane_strain" : "solid";
}

const char* name_of(contact::Method method) {
  return method == contact::Method::Embedded ? "embedded" : method == contact::Method::Snap ? "snap" : "adapt";
}

// `compile_s` when it was compiled just now.
void print_info(const std::string& name, const model::Image& image, std::size_t bytes, std::optional<double> compile_s, bool json) {
  const TickCost tick = tick_cost(image);
  const model::Tissue& t = image.tissue;
  const bool single = t.compliance64.empty();
  if (json) {
    fmt::print(
        "{{\"file\": {}, \"bytes\": {}, \"model\": \"{}\", \"candidates\": {}, \"cells\": {}, \"columns\": {}, \"edge_m\": {}, "
        "\"storage\": \"{}\", "
        "\"float32_compliance_error\": {}, \"float32_force_error\": {}, \"needle_length_m\": {}, \"needle_radius_m\": {}, \"method\": "
        "\"{}\", "
        "\"spacing_m\": {}, \"contacts\": {}, \"contacts_capacity\": {}, \"cells_per_bucket\": {}, \"cells_per_bucket_capacity\": {}, "
        "\"ring_cells\": {}, \"ring_cells_capacity\": {}, \"compile_s\": {}, \"tick_contacts\": {}, \"tick_insert_median_us\": {:.4g}, "
        "\"tick_insert_worst_us\": {:.4g}, \"tick_turn_median_us\": {:.4g}, \"tick_turn_worst_us\": {:.4g}}}\n",
        json_text(name), bytes, name_of(t.model), t.node_m.size(), t.cell.size(), t.unknowns(), t.edge_length_m,
        single ? "float32" : "float64", image.float32_error.compliance, image.float32_error.force, image.needle.length_m,
        image.needle.radius_m, name_of(image.law->method), image.law->spacing_m, image.need.contacts, capacity::contacts,
        image.need.cells_per_bucket, capacity::cells_per_bucket, image.need.ring_cells, capacity::ring_cells,
        compile_s ? fmt::format("{:.3f}", *compile_s) : "null", tick.contacts, tick.insert_median_us, tick.insert_worst_us,
        tick.turn_median_us, tick.turn_worst_us);
    return;
  }
  fmt::print("{}: {:.2f} MB, {}\n", name, mb(bytes), name_of(t.model));
  fmt::print("  candidates    {} nodes in {} cells, edges {:.3g} mm\n", t.node_m.size(), t.cell.size(), 1e3 * t.edge_length_m);
  fmt::print("  needle        {:.4g} m, radius {:.3g} mm; contacts {}, every {:.3g} mm\n", image.needle.length_m,
             1e3 * image.needle.radius_m, name_of(image.law->method), 1e3 * image.law->spacing_m);
  fmt::print("  capacities    contacts {} of {}, cells in a search {} of {}, cells around a node {} of {}\n", image.need.contacts,
             capacity::contacts, image.need.cells_per_bucket, capacity::cells_per_bucket, image.need.ring_cells, capacity::ring_cells);
  fmt::print("  storage       {}; float32 {} {:.1e} of the compliance and {:.1e} of the forces of a stuck line\n",
             single ? "float32" : "float64", single ? "costs" : "would cost", image.float32_error.compliance, image.float32_error.force);
  if (compile_s) fmt::print("  compile       {:.2f} s\n", *compile_s);
  if (tick.contacts == 0) {
    fmt::print("  tick          not measured: a needle through the middle of the candidates finds no contact\n");
    return;
  }
  fmt::print("  tick          with {} contacts, here: going in {:.1f} us (worst {:.0f}), base turning {:.1f} us (worst {:.0f})\n",
             tick.contacts, tick.insert_median_us, tick.insert_worst_us, tick.turn_median_us, tick.turn_worst_us);
}

}  // namespace

int scene_check(const std::string& name, bool json) {
  const scene::Scene scene = scene::read_scene(config::find_share("scenes", name));
  fem::Mesh mesh = condense::check_tissue(scene);
  if (!scene.needle || !scene.contact) {
    // For `trocar solve` alone; the compiler would refuse it.
    const std::size_t unknowns = mesh.node.size() * static_cast<std::size_t>(mesh.dimension());
    if (json) {
      fmt::print("{{\"file\": {}, \"nodes\": {}, \"elements\": {}, \"unknowns\": {}, \"compiles\": false}}\n",
                 json_text(scene.file.string()), mesh.node.size(), mesh.element.size(), unknowns);
    } else {
      fmt::print("{}: {} nodes, {} elements, {} unknowns\n  good to solve; to compile it needs [needle] and [contact]\n",
                 scene.file.string(), mesh.node.size(), mesh.element.size(), unknowns);
    }
    return 0;
  }
  const condense::Plan plan = condense::plan(scene, std::move(mesh));
  if (json) {
    fmt::print("{{\"file\": {}, {}, \"compiles\": true}}\n", json_text(scene.file.string()), plan_json(plan));
  } else {
    print_plan(stdout, scene, plan);
    fmt::print("  good to solve and to compile\n");
  }
  return 0;
}

int scene_compile(const SceneCompileOptions& o, const std::atomic<bool>& stop) {
  const scene::Scene scene = scene::read_scene(config::find_share("scenes", o.scene));
  const std::filesystem::path visible_path = o.visible.empty() ? std::filesystem::path(o.out.string() + ".visible") : o.visible;
  if (!o.without_visible && visible_path == o.out)
    throw config::UserError(fmt::format("{}: is both the image and the visible map; give --visible another name", o.out.string()));
  Bar bar;
  condense::Options options = compile_options(stop, bar);
  options.visible = o.without_visible ? condense::WithVisible::No : condense::WithVisible::Yes;
  options.most_memory_bytes = static_cast<std::size_t>(o.memory_gb * 1e9);
  const condense::Plan plan = condense::plan(scene, options.visible);
  // Places that cannot be written are noticed before the work.
  config::NewFile image_file(o.out);
  std::optional<config::NewFile> visible_file;
  if (!o.without_visible) visible_file.emplace(visible_path);
  print_plan(stderr, scene, plan);
  const condense::Compiled compiled = condense::compile(scene, plan, options);
  write(image_file, compiled.image.span());
  if (visible_file) {
    write(*visible_file, compiled.visible.span());
    visible_file->keep();
  }
  image_file.keep();
  bar.end();
  if (o.json) {
    fmt::print(
        "{{\"image\": {}, \"visible\": {}, {}, \"factor_bytes\": {}, \"factor_s\": {:.3f}, \"columns_s\": {:.3f}, \"compile_s\": "
        "{:.3f}}}\n",
        json_text(o.out.string()), visible_file ? json_text(visible_path.string()) : "null", plan_json(plan), compiled.factor_bytes,
        compiled.factor_s, compiled.columns_s, compiled.total_s);
    return 0;
  }
  fmt::print("{}: {:.1f} MB{}\n", o.out.string(), mb(compiled.image.span().size()),
             visible_file ? fmt::format(", {}: {:.1f} MB", visible_path.string(), mb(compiled.visible.span().size())) : "");
  fmt::print("  {:.2f} s: factor {:.2f} s ({:.0f} MB), {} columns {:.2f} s ({:.2f} ms each)\n", compiled.total_s, compiled.factor_s,
             mb(compiled.factor_bytes), plan.cost.columns, compiled.columns_s,
             1e3 * compiled.columns_s / static_cast<double>(plan.cost.columns));
  return 0;
}

int scene_info(const std::string& name, bool json, const std::atomic<bool>& stop) {
  const std::filesystem::path path(name);
  const bool is_scene = path.extension() == ".toml" || (!path.has_extension() && !std::filesystem::exists(path));
  if (!is_scene) {
    const image_file::MappedImage mapped(path);
    print_info(name, mapped.image(), mapped.bytes().size(), std::nullopt, json);
    return 0;
  }
  const scene::Scene scene = scene::read_scene(config::find_share("scenes", name));
  Bar bar;
  condense::Options options = compile_options(stop, bar);
  options.visible = condense::WithVisible::No;
  const condense::Compiled compiled = condense::compile_to_memory(scene, options);
  bar.end();
  model::Image image{};
  if (const model::ImageStatus status = model::open(compiled.image.span(), image); status != model::ImageStatus::Ok)
    throw config::UserError(scene.file.string() + ": the compiled image " + model::to_string(status));
  print_info(scene.file.string(), image, compiled.image.span().size(), compiled.total_s, json);
  return 0;
}

}  // namespace trocar::cli
