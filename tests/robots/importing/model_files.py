"""Small URDF and MJCF files for tests."""

CART_POLE = """<mujoco model="cartpole">
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <body name="cart" pos="0 0 0.5">
      <joint name="slider" type="slide" axis="1 0 0" range="-1 1" limited="true" damping="0.1"/>
      <geom type="box" size=".1 .05 .05" mass="1"/>
      <body name="pole">
        <joint name="hinge" type="hinge" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.6" size=".02" mass="0.2"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="slider" gear="10" ctrllimited="true" ctrlrange="-1 1"/></actuator>
</mujoco>
"""

ONE_LEG = """<mujoco model="stick">
  <compiler angle="degree"/>
  <worldbody>
    <body name="torso" pos="0 0 1">
      <freejoint/>
      <geom type="sphere" size=".1" mass="5"/>
      <body name="leg" pos="0 0 -0.1">
        <joint name="hip" axis="0 1 0" pos="0 0 0.02" range="-90 90" armature="0.01"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.4" size=".04" mass="2"/>
        <body name="shank" pos="0 0 -0.4" euler="0 20 0">
          <joint name="knee" axis="0 1 0" range="0 120" ref="20" frictionloss="0.3"/>
          <geom type="capsule" fromto="0 0 0 0 0 -0.4" size=".03" mass="1"/>
          <body name="foot" pos="0 0 -0.4"><geom type="sphere" size=".035" mass="0.1"/></body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="hip" gear="50" ctrlrange="-1 1"/>
    <position joint="knee" kp="100" forcerange="-40 40"/>
  </actuator>
  <keyframe><key name="home" qpos="0 0 1 1 0 0 0 0.2 0.3"/></keyframe>
</mujoco>
"""

PLANAR = """<mujoco model="hopper">
  <worldbody>
    <body name="torso" pos="0 0 1">
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="z" type="slide" axis="0 0 1"/>
      <joint name="pitch" axis="0 1 0"/>
      <geom type="sphere" size=".1" mass="5"/>
      <body name="leg">
        <joint name="hip" axis="0 1 0" range="-60 60"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.5" size=".03" mass="1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

SPHERICAL_HIP = """<mujoco model="hip">
  <worldbody>
    <body name="torso">
      <freejoint/>
      <geom type="sphere" size=".1" mass="5"/>
      <body name="leg">
        <joint name="roll" axis="1 0 0" range="-60 60"/>
        <joint name="pitch" axis="0 1 0" range="-60 60"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.5" size=".03" mass="1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

INERTIAL = """<inertial><origin xyz="0 0 0.2"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>"""

ARM = f"""<robot name="arm">
  <link name="world"/>
  <link name="base">{INERTIAL}</link>
  <joint name="mount" type="fixed">
    <parent link="world"/><child link="base"/><origin xyz="0 0 1" rpy="0 0 1.5707963267948966"/>
  </joint>
  <link name="upper">{INERTIAL}
    <collision><geometry><mesh filename="package://nowhere/upper.stl"/></geometry></collision>
  </link>
  <joint name="shoulder" type="continuous">
    <parent link="base"/><child link="upper"/><axis xyz="0 2 0"/>
  </joint>
  <link name="lower">{INERTIAL}
    <collision><origin xyz="0 0 0.2"/><geometry><cylinder radius="0.03" length="0.4"/></geometry>
    </collision>
  </link>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="lower"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="20" velocity="5"/>
    <dynamics damping="0.1" friction="0.2"/>
  </joint>
</robot>
"""

DRONE = """<mujoco model="drone">
  <compiler angle="degree"/>
  <default><motor ctrlrange="0 6"/></default>
  <worldbody>
    <body name="frame" pos="0 0 0.1" euler="0 0 90">
      <freejoint/>
      <geom type="box" size=".1 .1 .02" mass="1"/>
      <site name="left" pos="0 0.2 0.05"/>
      <body name="arm" pos="0 -0.2 0">
        <geom type="box" size=".02 .02 .02" mass="0.1"/>
        <site name="right" pos="0 0 0.05" euler="0 90 0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="a" site="left" gear="0 0 2 0 0 -0.04"/>
    <general name="b" site="right" gear="-1 0 0 0.01 0 0" dyntype="filterexact" dynprm="0.03"
             gainprm="1.5" ctrlrange="-1 4"/>
    <motor name="c" site="left" gear="0 0 0 1 0 0"/>
    <motor name="d" site="left" gear="0 0 1 1 0 0"/>
  </actuator>
</mujoco>
"""
