// trocar: the host's command line.
#include <fmt/format.h>
#include <sys/prctl.h>
#include <CLI/CLI.hpp>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <string>

#include "common/config/rig_file.hpp"
#include "common/config/share.hpp"
#include "common/config/user_error.hpp"
#include "host/capture/recorder.hpp"
#include "host/cli/check_command.hpp"
#include "host/cli/demo.hpp"
#include "host/cli/insert_command.hpp"
#include "host/cli/needle_command.hpp"
#include "host/cli/process.hpp"
#include "host/cli/rig_commands.hpp"
#include "host/cli/scene_commands.hpp"
#include "host/keys/keys.hpp"
#include "host/solve/solve.hpp"

namespace {

using namespace trocar;

std::atomic<bool> stop_asked{false};
void on_signal(int) { stop_asked.store(true); }

}  // namespace

// NOLINTNEXTLINE(bugprone-exception-escape): what adds options throws when they contradict each other, in any call
int main(int argc, char** argv) {
  CLI::App app{"trocar: runs a needle-insertion rig, or a simulated one.\nExample: trocar demo"};
  app.require_subcommand(1);
  std::int64_t domain = -1;
  std::string rig = "ubc_twin";
  bool json = false;
  int code = 0;

  const auto domain_of = [&] {
    return domain >= 0 ? static_cast<std::uint32_t>(domain) : config::read_rig(config::find_share("rigs", rig)).dds_domain;
  };
  const auto with_domain = [&](CLI::App* c) {
    c->add_option("--domain", domain, "DDS domain instead of the rig file's")->check(CLI::Range(0, 230));
  };
  const auto with_experiment = [&](CLI::App* c, cli::DemoOptions& o) {
    c->add_option("--speeds", o.speeds_mm_s, "insertion speeds in mm/s instead of the experiment's, such as 1,3,5,7,9")
        ->delimiter(',')
        ->check(CLI::Range(0.01, 200.0));
    c->add_option("--out", o.out, "folder for the results (default runs/<time>)");
    c->add_flag("--json", o.json, "the summary as JSON on stdout");
    with_domain(c);
  };

  cli::DemoOptions demo;
  auto* demo_command =
      app.add_subcommand("demo",
                         "the whole simulated experiment: plant, controller, recorder, report\nExample: trocar demo --speeds 1,9\nA "
                         "virtual needle in a simulated hand: trocar demo --haptic");
  with_experiment(demo_command, demo);
  auto* which =
      demo_command->add_option("--experiment", demo.experiment, "experiment name, or path of its TOML file")->capture_default_str();
  demo_command
      ->add_flag_callback(
          "--haptic", [&] { demo.experiment = "haptic"; }, "the same as --experiment haptic: a virtual needle in the hand")
      ->excludes(which);
  demo_command->add_option("--hand", demo.hand, "who holds the simulated rig's handle, instead of the experiment's: hand name, or path");
  demo_command->add_flag("--lockstep", demo.lockstep, "on the bench: one process, virtual clock, repeatable to the bit");
  demo_command->add_flag_callback(
      "--no-camera", [&] { demo.camera = false; }, "without the camera over the phantom, its tracked markers and their files");
  demo_command->add_option("--seed", demo.seed, "of the simulated noise")->capture_default_str();
  demo_command->callback([&] {
    demo.domain = domain;
    code = cli::run_demo(demo, stop_asked);
  });

  auto* experiment_command = app.add_subcommand("experiment", "run an experiment on a rig that is already up");
  experiment_command->require_subcommand(1);
  cli::DemoOptions experiment;
  experiment.own_rig = false;
  auto* run_command = experiment_command->add_subcommand(
      "run",
      "Example: trocar experiment run insertion --speeds 3\nWith a trocar-rig that was given a --model: trocar experiment run haptic");
  run_command->add_option("experiment", experiment.experiment, "experiment name, or path of its TOML file")->required();
  with_experiment(run_command, experiment);
  run_command->callback([&] {
    experiment.domain = domain;
    code = cli::run_demo(experiment, stop_asked);
  });

  auto* scene_command = app.add_subcommand("scene", "check a scene, compile it into a model image, look at scenes and images");
  scene_command->require_subcommand(1);
  std::string scene;
  cli::SceneCompileOptions compile;
  const auto add_scene = [&](const char* name, const char* text, std::string& what, const char* what_text) {
    auto* c = scene_command->add_subcommand(name, text);
    c->add_option("scene", what, what_text)->required();
    c->add_flag("--json", json, "machine-readable, on stdout");
    return c;
  };
  add_scene("check", "read a scene, mesh it, try its supports, and say what compiling would cost\nExample: trocar scene check phantom",
            scene, "scene name, or path of its TOML file")
      ->callback([&] { code = cli::scene_check(scene, json); });
  add_scene("info",
            "sizes, capacities, storage error and tick cost of an image, or of a scene compiled in memory\nExample: trocar scene info "
            "phantom.image",
            scene, "path of an image, or scene name, or path of a scene's TOML file")
      ->callback([&] { code = cli::scene_info(scene, json, stop_asked); });
  auto* compile_command = add_scene("compile",
                                    "condense a scene into the image that trocar-rig runs, and the map from its forces to what is drawn\n"
                                    "Example: trocar scene compile phantom --out phantom.image",
                                    compile.scene, "scene name, or path of its TOML file");
  compile_command->add_option("--out", compile.out, "the image, written anew")->required();
  auto* visible_option =
      compile_command->add_option("--visible", compile.visible, "the visible map (default: the image's name and .visible)");
  compile_command->add_flag("--no-visible", compile.without_visible, "write no visible map")->excludes(visible_option);
  compile_command->add_option("--memory", compile.memory_gb, "GB that compiling may take")
      ->capture_default_str()
      ->check(CLI::Range(0.01, 1e6));
  compile_command->callback([&] {
    compile.json = json;
    code = cli::scene_compile(compile, stop_asked);
  });

  auto* solve_command = app.add_subcommand("solve",
                                           "static finite elements: displacements of a scene's tissue under loads on its nodes\nExample: "
                                           "trocar solve phantom --loads loads.csv --out "
                                           "displacements.csv --vtu fields.vtu\nLoads: x_m,y_m,fx_n,fy_n, for solids "
                                           "x_m,y_m,z_m,fx_n,fy_n,fz_n; one node a row, forces on one node add up.\n"
                                           "Results: node,x_m,y_m,ux_m,uy_m, for solids node,x_m,y_m,z_m,ux_m,uy_m,uz_m.");
  host::SolveOptions solve;
  solve_command->add_option("scene", scene, "scene name, or path of its TOML file")->required();
  solve_command->add_option("--loads", solve.loads, "CSV of forces")->required();
  solve_command->add_option("--out", solve.out, "CSV of displacements, written anew")->required();
  solve_command->add_option("--vtu", solve.vtu, "fields for ParaView: displacement, load, stress, material");
  solve_command->add_flag("--json", json, "the summary as JSON on stdout");
  solve_command->callback([&] {
    solve.scene = config::find_share("scenes", scene);
    solve.progress = [](const std::string& line) { fmt::print(stderr, "trocar solve: {}\n", line); };
    const host::SolveSummary summary = host::run_solve(solve, stop_asked);
    fmt::print("{}\n", json ? host::to_json(summary) : host::to_text(summary));
  });

  auto* record_command = app.add_subcommand(
      "record", "record everything that a rig publishes to an MCAP file until Ctrl-C\nExample: trocar record --out run.mcap");
  host::RecordOptions record;
  record_command->add_option("--out", record.out, "a file that ends in .mcap, or a folder")->required();
  record_command->add_option("--rig", rig, "rig whose DDS domain to listen to")->capture_default_str();
  bool die_with_parent = false;
  record_command->add_flag("--die-with-parent", die_with_parent, "stop orderly when the process that started this one ends");
  with_domain(record_command);
  record_command->callback([&] {
    if (die_with_parent) prctl(PR_SET_PDEATHSIG, SIGTERM);
    record.domain = domain_of();
    record.say = [](const std::string& line) {
      fmt::print("{}\n", line);
      std::fflush(stdout);
    };
    code = host::run_record(record, stop_asked);
  });

  auto* report_command = app.add_subcommand(
      "report", "make figures and report.html from the folder of a run\nExample: trocar report runs/2026-01-31_12-00-00");
  std::filesystem::path folder;
  report_command->add_option("folder", folder, "folder of a run")->required();
  report_command->add_flag("--json", json, "the summary as JSON on stdout");
  report_command->callback([&] { code = cli::make_report(folder, json); });

  auto* insert_command =
      app.add_subcommand("insert",
                         "a needle along a base path through a scene, by the model that runs in the controller\n"
                         "Example: trocar insert phantom.toml --path path.csv --out result.csv --contacts-out contacts.csv");
  cli::InsertOptions insert;
  insert_command->add_option("scene", insert.scene, "scene file, or the name of one that comes with trocar")->required();
  insert_command->add_option("--path", insert.path, "CSV t_s,x_m,y_m,theta_rad: poses of the needle's base; theta from base to tip")
      ->required();
  insert_command->add_option("--out", insert.out, "CSV to write: a row a path row, with base wrench, contacts, residual")->required();
  insert_command->add_option("--contacts-out", insert.contacts_out, "CSV to write: every contact of every row");
  insert_command->add_option("--method", insert.method, "embedded, snap, adapt or subdivide instead of the scene's");
  insert_command->add_flag("--json", insert.json, "the summary as JSON on stdout");
  insert_command->callback([&] {
    insert.scene = config::find_share("scenes", insert.scene.string());
    code = cli::run_insert(insert);
  });

  auto* needle_command = app.add_subcommand("needle", "needles by themselves");
  needle_command->require_subcommand(1);
  auto* bend_command = needle_command->add_subcommand(
      "bend",
      "the shape of a needle that bends under forces that keep their direction; base clamped at the origin, along +x\n"
      "Example: trocar needle bend chiba_20g --tip-force 0,0.2 --at 0.07,0,-0.1 --out shape.csv\n"
      "Result: s_m,x_m,y_m,theta_rad, s along the unloaded needle, a row for each node and mid-node of the elements.\n"
      "With model = \"thesis\" a row for each column of nodes of its triangles, and which of its methods found the shape.");
  cli::NeedleBendOptions bend;
  const auto numbers = [](std::size_t count, const char* pattern) {
    return CLI::Validator([count, pattern](std::string& text) { return cli::wrong_numbers(text, count, pattern); }, pattern);
  };
  bend_command
      ->add_option("needle", bend.needle,
                   "needle name, or path of a TOML file that holds the table [needle] alone, or of a whole scene; model = \"beam\" "
                   "or \"thesis\"")
      ->required();
  bend_command->add_option("--tip-force", bend.tip_force, "force on the tip, N")->check(numbers(2, "FX,FY"));
  bend_command->add_option("--tip-moment", bend.tip_moment_nm, "moment on the tip, N m, counter-clockwise")->check(CLI::Range(-1e6, 1e6));
  bend_command->add_option("--at", bend.at, "force at S m from the base, N; may be given again")
      ->check(numbers(3, "S,FX,FY"))
      ->allow_extra_args(false);
  bend_command->add_option("--out", bend.out, "CSV of the shape, written anew")->required();
  bend_command->add_flag("--json", bend.json, "the summary as JSON on stdout");
  bend_command->callback([&] {
    bend.needle = config::find_share("needles", bend.needle.string());
    code = cli::needle_bend(bend);
  });

  // A program of its own: OpenCV would add some 50 ms to the start of every command (host/camera/README.md).
  auto* camera_command = app.add_subcommand("camera",
                                            "list, grab from, calibrate, rectify, register and simulate cameras\nExample: trocar camera "
                                            "calibrate left*.jpg --board 9x6 --square-m 0.025 --out camera.toml");
  camera_command->prefix_command();
  camera_command->set_help_flag();
  camera_command->callback([&] { cli::become_program("trocar-camera", camera_command->remaining()); });

  auto* track_command = app.add_subcommand(
      "track",
      "follow the markers of a phantom in a camera's frames\nExample: trocar track frames/ --camera camera.toml --out markers.csv");
  track_command->prefix_command();
  track_command->set_help_flag();
  track_command->callback([&] {
    std::vector<std::string> words = track_command->remaining();
    words.insert(words.begin(), "track");
    cli::become_program("trocar-camera", words);
  });

  auto* keys_command = app.add_subcommand(
      "keys",
      "make the keys with which rig and host speak over a network instead of within one machine\n"
      "Example: trocar keys keys/ --interface eth1 --peer 192.168.7.1 --peer 192.168.7.2\n"
      "Then: copy keys/rig to the rig's machine, keys/host to yours, and set TROCAR_KEYS there to that folder. ca_key.pem stays with you.");
  keys::Options network;
  keys_command->add_option("folder", network.folder, "folder to make")->required();
  keys_command->add_option("--interface", network.interface, "network interface on which both machines meet")->required();
  keys_command->add_option("--peer", network.peers, "address of a machine there; give each of them")->required();
  keys_command->callback([&] {
    keys::make(network);
    fmt::print("{}: keys for rig, host and observer; on each machine: export TROCAR_KEYS=FOLDER/ROLE\n", network.folder.string());
  });

  auto* rig_command = app.add_subcommand("rig", "look at a rig, home, arm, hold and stop it");
  rig_command->require_subcommand(1);
  const auto add_rig = [&](const char* name, const char* text, auto run) {
    auto* c = rig_command->add_subcommand(name, text);
    c->add_option("rig", rig, "rig name, or path of its TOML file")->capture_default_str();
    with_domain(c);
    c->add_flag("--json", json, "machine-readable, on stdout");
    c->callback([&, run] { code = run(); });
  };
  add_rig("info", "what a rig file describes: workspace, resolution, forces, bus load\nExample: trocar rig info ubc_twin_haptic",
          [&] { return cli::rig_info(rig, json); });
  cli::RigCheckOptions check;
  add_rig("check",
          "whether this machine is fit for motors: runs the controller's loop without the rig, and says how late it woke up, how long its "
          "ticks took, and what to mend; exit code 0 fit for motors, 1 only for simulation\nExample: trocar rig check ubc_twin --load",
          [&] {
            check.rig = rig;
            check.json = json;
            return cli::rig_check(check, stop_asked);
          });
  auto* check_command = rig_command->get_subcommand("check");
  check_command->remove_option(check_command->get_option("--domain"));  // nothing of it crosses DDS
  check_command->add_option("--seconds", check.seconds, "how long; 99.99 % means something from 10000 ticks on")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  check_command->add_option("--cpu", check.cpu, "core to run the loop on, as trocar-rig is going to be started")
      ->check(CLI::NonNegativeNumber);
  check_command->add_flag("--load", check.load, "keep all cores, the memory and a disk busy meanwhile");
  add_rig("status", "what the running controller is doing", [&] { return cli::rig_status(domain_of(), json); });
  add_rig("home", "take the encoder offsets; the handle stands in its jig", [&] { return cli::rig_home(domain_of()); });
  add_rig("arm", "enable torque and stay armed until Ctrl-C", [&] { return cli::rig_arm(domain_of(), stop_asked); });
  std::string display = "four_channel";
  add_rig("haptic",
          "arm, and let a hand feel the model that trocar-rig was given, until Ctrl-C\nExample: trocar rig haptic --display impedance",
          [&] { return cli::rig_haptic(domain_of(), display, stop_asked); });
  rig_command->get_subcommand("haptic")
      ->add_option("--display", display, "how: four_channel, impedance or admittance")
      ->check(CLI::IsMember({"four_channel", "impedance", "admittance"}))
      ->capture_default_str();
  add_rig("hold", "brake and hold; open to everybody", [&] { return cli::rig_hold(domain_of()); });
  add_rig("stop", "brake, then torque off; open to everybody", [&] { return cli::rig_stop(domain_of()); });
  add_rig("reset", "clear a latched fault whose cause is gone", [&] { return cli::rig_reset(domain_of()); });

  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is an error to tell, not a reason to die
  try {
    app.parse(argc, argv);
    return code;
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  } catch (const std::exception& e) {
    fmt::print(stderr, "trocar: {}\n", e.what());
    return 1;
  }
}
