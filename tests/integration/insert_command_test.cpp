// trocar insert as a person starts it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <vector>

#include "harness.hpp"

namespace trocar::testing {
namespace {

// 30 mm in and out again along the axis of the shipped phantom, in rows of a millimetre.
std::string stroke() {
  std::ostringstream csv;
  csv.precision(17);
  csv << "t_s,x_m,y_m,theta_rad\n";
  for (int k = -1; k <= 63; ++k) csv << k + 1 << ",0," << 0.115 + 0.001 * (k <= 31 ? k : 62 - k) << ",1.5707963267948966\n";
  return csv.str();
}

struct Table {
  std::string header{};
  std::vector<std::vector<std::string>> rows{};
  [[nodiscard]] double number(std::size_t row, std::size_t column) const { return std::stod(rows.at(row).at(column)); }
};

Table read_table(const std::filesystem::path& file) {
  std::istringstream text(read_text(file));
  Table table;
  std::getline(text, table.header);
  for (std::string line; std::getline(text, line);) {
    std::istringstream fields(line);
    table.rows.emplace_back();
    for (std::string field; std::getline(fields, field, ',');) table.rows.back().push_back(field);
  }
  return table;
}

TEST(InsertCommand, WritesARowAPathRowThatItsContactsExplain) {
  for (const std::string method : {"embedded", "snap", "adapt", "subdivide"}) {
    const Scratch scratch;
    write_text(scratch / "scene.toml", shared_file("scenes/phantom.toml", {{"element = \"quad4\"", "element = \"tri3\""}}));
    write_text(scratch / "path.csv", stroke());
    Program run(scratch, "trocar",
                {"insert", (scratch / "scene.toml").string(), "--path", (scratch / "path.csv").string(), "--out",
                 (scratch / "result.csv").string(), "--contacts-out", (scratch / "contacts.csv").string(), "--method", method, "--json"});
    ASSERT_EQ(run.wait(60.0), 0) << method << run.errors();
    EXPECT_NE(run.out().find("\"rows\": 65"), std::string::npos) << run.out();
    const Table result = read_table(scratch / "result.csv");
    EXPECT_EQ(result.header,
              "t_s,x_m,y_m,theta_rad,tip_x_m,tip_y_m,tip_theta_rad,base_fx_n,base_fy_n,base_tau_nm,contacts,residual_n,pivots,solve_us");
    ASSERT_EQ(result.rows.size(), 65u);
    const Table contacts = read_table(scratch / "contacts.csv");
    EXPECT_EQ(contacts.header, "step,contact,x_m,y_m,arclength_m,f_axial_n,f_lateral_n,state");
    std::vector<double> fy(65);
    std::vector<double> tau(65);
    std::vector<int> count(65);
    for (std::size_t i = 0; i < contacts.rows.size(); ++i) {
      const auto row = static_cast<std::size_t>(contacts.number(i, 0));
      fy.at(row) += contacts.number(i, 5);  // the needle points along +y: its axis is y, its normal -x
      tau.at(row) +=
          (contacts.number(i, 2) - 0.0) * contacts.number(i, 5) + (contacts.number(i, 3) - result.number(row, 2)) * contacts.number(i, 6);
      ++count.at(row);
    }
    for (std::size_t i = 0; i < 65; ++i) {
      EXPECT_NEAR(result.number(i, 8), fy[i], 1e-12) << method << i;
      EXPECT_NEAR(result.number(i, 9), tau[i], 1e-12) << method << i;
      EXPECT_EQ(result.number(i, 10), count[i]) << method << i;
      EXPECT_LT(result.number(i, 11), 1e-9) << method << i;
    }
    EXPECT_GT(result.number(32, 8), 0.8) << method;   // pushes in
    EXPECT_LT(result.number(48, 8), -0.3) << method;  // holds back on the way out
    EXPECT_EQ(result.number(64, 10), 0.0) << method;
  }
}

// Hardly any friction, so the tip cuts the straight line: a contact for every grid line and diagonal that it crosses. These two lines pass
// no node of the grids closer than a twentieth of an edge, where one node stands for the edges around it.
TEST(InsertCommand, SubdivideMakesAContactOfEveryCrossingOfAnObliquePath) {
  struct Line {
    double x_m, angle_rad;
  };
  constexpr double depth_m = 0.024;
  constexpr double needle_m = 0.10;
  for (const Line& line : {Line{-0.0039, 0.45}, Line{-0.0011, -0.45}}) {
    const double tx = std::sin(line.angle_rad);
    const double ty = std::cos(line.angle_rad);
    for (const int nodes : {21, 41, 81}) {
      const double edge_m = 0.1 / (nodes - 1);
      int crossed = 0;
      for (int i = -nodes; i <= nodes; ++i)
        for (const double along : {i * edge_m / ty, (i * edge_m - line.x_m) / tx, (i * edge_m + line.x_m) / (ty - tx)})
          crossed += along >= 0.0 && along <= depth_m ? 1 : 0;
      const Scratch scratch;
      std::ostringstream grid, corridor, csv;
      for (std::ostringstream* text : {&grid, &corridor, &csv}) text->precision(17);
      grid << "nodes = [" << nodes << ", " << nodes << "], element = \"tri3\"";
      corridor << "corridor = { from_m = [" << line.x_m << ", 0.215], to_m = [" << line.x_m + 0.03 * tx << ", " << 0.215 + 0.03 * ty
               << "], half_width_m = 0.006 }";
      write_text(scratch / "scene.toml", shared_file("scenes/phantom.toml", {{"nodes = [21, 21], element = \"quad4\"", grid.str()},
                                                                             {"velocity_law = \"phantom_pvc\"", corridor.str()},
                                                                             {"shaft_n_per_m = 34.0", "shaft_n_per_m = 1e-4"},
                                                                             {"tip_n_per_m = 68.0", "tip_n_per_m = 2e-4"}}));
      csv << "t_s,x_m,y_m,theta_rad\n";
      for (int k = -2; k <= 24; ++k)
        csv << k + 2 << ',' << line.x_m + (0.001 * k - needle_m) * tx << ',' << 0.215 + (0.001 * k - needle_m) * ty << ','
            << std::numbers::pi / 2 - line.angle_rad << '\n';
      write_text(scratch / "path.csv", csv.str());
      Program run(scratch, "trocar",
                  {"insert", (scratch / "scene.toml").string(), "--path", (scratch / "path.csv").string(), "--out",
                   (scratch / "r.csv").string(), "--method", "subdivide"});
      ASSERT_EQ(run.wait(60.0), 0) << run.errors();
      EXPECT_EQ(run.errors(), "");
      const Table result = read_table(scratch / "r.csv");
      EXPECT_EQ(result.number(26, 10), crossed) << nodes << " nodes, " << line.angle_rad << " rad";
    }
  }
}

// Two contacts on nodes, one of them frictionless: force-free at first, then held by one spring of the tissue's own.
TEST(InsertCommand, TakesExplicitContacts) {
  const Scratch scratch;
  write_text(scratch / "scene.toml",
             shared_file("scenes/phantom.toml",
                         {{"method = \"embedded\"", "points_m = [[0.0, 0.225], [0.0, 0.235]]\nslip_force_n = [0.0, 0.2]"}}));
  write_text(scratch / "path.csv",
             "t_s,x_m,y_m,theta_rad\n0,0,0.15,1.5707963267948966\n1,0,0.1505,1.5707963267948966\n2,0,0.17,1.5707963267948966\n");
  Program run(scratch, "trocar",
              {"insert", (scratch / "scene.toml").string(), "--path", (scratch / "path.csv").string(), "--out",
               (scratch / "r.csv").string(), "--contacts-out", (scratch / "c.csv").string()});
  ASSERT_EQ(run.wait(60.0), 0) << run.errors();
  const Table result = read_table(scratch / "r.csv");
  const Table contacts = read_table(scratch / "c.csv");
  ASSERT_EQ(contacts.rows.size(), 6u);
  EXPECT_NEAR(result.number(0, 8), 0.0, 1e-12);
  EXPECT_EQ(contacts.number(2, 5), 0.0);
  EXPECT_GT(contacts.number(3, 5), 0.0);
  EXPECT_EQ(contacts.rows[3][7], "stuck");
  EXPECT_NEAR(contacts.number(3, 4), 0.085, 1e-12);
  EXPECT_NEAR(contacts.number(5, 5), 0.2, 1e-15);
  EXPECT_EQ(contacts.rows[5][7], "slip_forward");
  EXPECT_LT(contacts.number(5, 4), 0.085);
}

TEST(InsertCommand, RefusesInOneLineAndLeavesNothing) {
  const Scratch scratch;
  write_text(scratch / "path.csv", stroke());
  write_text(scratch / "unsorted.csv", "t_s,x_m,y_m,theta_rad\n1,0,0.1,1.5\n0,0,0.1,1.5\n");
  write_text(scratch / "degrees.csv", "t_s,x_m,y_m,theta_deg\n1,0,0.1,90\n");
  const auto scene = [&](const std::string& name, const Edits& edits) {
    write_text(scratch / name, shared_file("scenes/phantom.toml", edits));
    return (scratch / name).string();
  };
  const std::string good = scene("good.toml", {});
  const std::string thesis = scene("thesis.toml", {{"model = \"rigid\"", "model = \"thesis\"\ngauge = \"22G\""}});
  const std::string off = scene("off.toml", {{"method = \"embedded\"", "points_m = [[0.001, 0.225]]\nslip_force_n = [0.1]"}});
  const std::string outside = scene("outside.toml", {{"method = \"embedded\"", "points_m = [[0.0, 0.5]]\nslip_force_n = [0.1]"}});
  const std::string many = scene("many.toml", {{"method = \"embedded\"", "spacing_m = 0.0001"}});
  const std::string narrow =
      scene("narrow.toml", {{"method = \"embedded\"", "corridor = { from_m = [0.0, 0.215], to_m = [0.0, 0.225], half_width_m = 0.001 }"}});
  struct Case {
    std::string scene, path, says;
    std::vector<std::string> more{};
  };
  for (const Case& c : {Case{good, "unsorted.csv", "unsorted.csv:3"}, Case{good, "degrees.csv", "theta_rad"},
                        Case{good, "missing.csv", "missing.csv"}, Case{thesis, "path.csv", "offline"}, Case{off, "path.csv", "shaft"},
                        Case{outside, "path.csv", "outside"}, Case{many, "path.csv", "spacing_m"}, Case{narrow, "path.csv", "corridor"},
                        Case{good, "path.csv", "embedded, snap, adapt or subdivide", {"--method", "glue"}},
                        Case{good, "path.csv", "tri3", {"--method", "subdivide"}}}) {
    std::vector<std::string> arguments{"insert",         c.scene,
                                       "--path",         (scratch / c.path).string(),
                                       "--out",          (scratch / "out.csv").string(),
                                       "--contacts-out", (scratch / "contacts.csv").string()};
    arguments.insert(arguments.end(), c.more.begin(), c.more.end());
    Program run(scratch, "trocar", arguments);
    EXPECT_EQ(run.wait(60.0), 1) << c.says;
    const std::string errors = run.errors();
    EXPECT_NE(errors.find(c.says), std::string::npos) << errors;
    EXPECT_EQ(std::count(errors.begin(), errors.end(), '\n'), 1) << errors;
    for (const auto& entry : std::filesystem::directory_iterator(scratch.folder()))
      EXPECT_EQ(entry.path().filename().string().find("out.csv"), std::string::npos) << entry.path();
  }
}

}  // namespace
}  // namespace trocar::testing
