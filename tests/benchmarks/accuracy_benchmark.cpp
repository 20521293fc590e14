#include <fmt/core.h>
#include "tests/benchmarks/accuracy/method.hpp"
#include <chrono>
using namespace trocar;
using namespace trocar::bench;
int main(){
  auto now=[]{return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();};
  for(const Path&p:paths()) for(int level:{0,1,2}){ double a=now(); auto pts=visible_points(p,0.03,0.02); Answer r=fine_answer(p,0.0303,level,pts); fmt::print("{} level {} axial {:.5f} lateral {:.5f} slip {:.6f} share {:.3f} tip {:.6g} vis {:.6f} {:.6f} {:.6g} {:.2f} s\n",p.name,level,r.axial_n_per_m,r.lateral_n_per_m,r.slip_force_n,r.slipping,r.tip_m,r.axial_visible.norm(),r.lateral_visible.norm(),r.slip_visible_m.norm(),now()-a); std::fflush(stdout);}
  for(const Path&p:paths()) for(int n:{11,21,41,81}) for(auto m:{contact::Method::Snap,contact::Method::Adapt,contact::Method::Embedded,contact::Method::Subdivide}){
    double a=now(); auto sc=block_scene(fem::Type::Tri3,n,p); auto pts=visible_points(p,0.03,0.02);
    try{ std::unique_ptr<Compiled> c= m==contact::Method::Subdivide?std::make_unique<Compiled>(sc,subdivided_mesh(sc,p,0.0303)):std::make_unique<Compiled>(sc);
    auto q=coarse_answer(*c,m,p,0.0303,pts); auto&r=q.answer;
    fmt::print("{} {} {} axial {:.5f} lateral {:.5f} slip {:.6f} tip {:.6g} vis {:.6f} {:.6f} {:.6g} contacts {} {} {:.2f} s\n",p.name,n,name_of(m),r.axial_n_per_m,r.lateral_n_per_m,r.slip_force_n,r.tip_m,r.axial_visible.norm(),r.lateral_visible.norm(),r.slip_visible_m.norm(),q.contacts,to_string(q.status),now()-a);}
    catch(const std::exception&e){fmt::print("{} {} {} FAILED {}\n",p.name,n,name_of(m),e.what());}
    std::fflush(stdout);
  }
}
