#include <fmt/core.h>
#include "tests/benchmarks/accuracy/method.hpp"
#include <chrono>
#include <cmath>
#include <optional>
using namespace trocar;
using namespace trocar::bench;
int main(){
  const std::vector<double> depths{0.026,0.0281,0.0303,0.0322,0.0343};
  for(const Path&p:paths()) { 
    std::vector<Answer> refs; for(double d:depths) {refs.push_back(fine_answer(p,d,1,visible_points(p,d,0.02))); auto&r=refs.back(); fmt::print("ref {} {} {:.4f} {:.4f} slip {:.5f} share {:.3f} tip {:.4g}\n",p.name,d,r.axial_n_per_m,r.lateral_n_per_m,r.slip_force_n,r.slipping,r.tip_m);}
    for(auto type:{fem::Type::Tri3,fem::Type::Quad4}) for(int n:{11,21,41,61,81}) { auto sc=block_scene(type,n,p); Compiled c(sc);
     for(auto m:{contact::Method::Snap,contact::Method::Adapt,contact::Method::Embedded,contact::Method::Subdivide}){
      if(type==fem::Type::Quad4&&m==contact::Method::Subdivide) continue;
      double e[7]={}; double mean[2]={}; auto worst=insertion::Status::Ok; try{
      for(std::size_t k=0;k<depths.size();++k){ double d=depths[k]; auto pts=visible_points(p,d,0.02); std::optional<Compiled> own; if(m==contact::Method::Subdivide) own.emplace(subdivided(sc,p,d));
       auto q=coarse_answer(own?*own:c,m,p,d,pts); auto&r=q.answer; auto&f=refs[k]; worst=std::max(worst,q.status);
       auto sq=[](double x){return x*x;};
       mean[0]+=(r.axial_n_per_m/f.axial_n_per_m-1)/5; mean[1]+=(r.lateral_n_per_m/f.lateral_n_per_m-1)/5;
       e[0]+=sq(r.axial_n_per_m/f.axial_n_per_m-1); e[1]+=sq(r.lateral_n_per_m/f.lateral_n_per_m-1); e[2]+=sq((r.axial_visible-f.axial_visible).norm()/f.axial_visible.norm()); e[3]+=sq((r.lateral_visible-f.lateral_visible).norm()/f.lateral_visible.norm()); e[4]+=sq(r.slip_force_n/f.slip_force_n-1); e[5]+=sq((r.slip_visible_m-f.slip_visible_m).norm()/f.slip_visible_m.norm()); e[6]+=sq(r.tip_m/f.tip_m-1);}
      fmt::print("{:14} {} {:3} {:10}",p.name,type==fem::Type::Tri3?"tri":"quad",n,name_of(m)); for(double x:e) fmt::print(" {:8.3f}",100*std::sqrt(x/5)); fmt::print("  mean {:6.2f} {:6.2f} {}\n",100*mean[0],100*mean[1],to_string(worst));
      }catch(const std::exception&x){fmt::print("{} {} {} FAILED {}\n",p.name,n,name_of(m),x.what());}
      std::fflush(stdout);
  }}}
}
